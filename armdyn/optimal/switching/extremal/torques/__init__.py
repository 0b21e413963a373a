"""Torques of a march: constant on limits, along a course where they are free."""
