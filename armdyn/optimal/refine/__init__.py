"""From optima of a mesh to answers: arcs, smooth optima, path constraints."""
