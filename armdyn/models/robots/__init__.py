"""Robots, and where they come from."""
