"""Positions with units and names, as typed; layout of the help."""
