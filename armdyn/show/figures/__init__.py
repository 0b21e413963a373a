"""Figures of sweeps, loops and payloads; colours, lines and limits of all figures."""
