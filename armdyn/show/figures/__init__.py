"""Figures of sweeps and loops; colours, lines and limits of all figures."""
