"""Cycles: moves, grasps, releases and waits in order, as fast as possible together."""
