"""From optima of a mesh to answers: arcs, smooth optima, conditions along the way."""
