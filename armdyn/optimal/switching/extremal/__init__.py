"""Extremals: switching structures, integrated and optimised in their switching times."""
