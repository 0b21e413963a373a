"""Refinement of a mesh's optima: arcs, smooth optima, path constraints, curves."""
