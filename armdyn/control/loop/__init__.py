"""Sampled loops, references at their ticks, and the interface of controllers."""
