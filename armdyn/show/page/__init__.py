"""Pages in which an arm moves: the scene, curves over time, verdicts and numbers."""
