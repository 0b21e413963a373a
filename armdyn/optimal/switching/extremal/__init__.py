"""Structures of limits carried through by an integrator, and their fastest times."""
