"""Simulated runs of a controller on an arm, and their verdict."""
