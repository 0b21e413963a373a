"""Torques replayed through the arm, held against its limits, and brought onto the goal."""
