"""Motions from a moving state to rest within milliseconds: sequential quadratic programs from the last motion."""
