"""Arcs: sequences of active limits, detected, corrected, and solved for their durations."""
