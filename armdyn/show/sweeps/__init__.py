"""Figures of sweeps, and what is left of them on disk."""
