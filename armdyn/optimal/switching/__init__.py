"""Switching times: extremals of known structure by an integrator, and structures mended by their costates."""
