"""Pages in which an arm moves: the scene, curves over time, and what is said of a motion."""
