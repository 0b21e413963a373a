"""Controllers: each is numbers, and makes a law of a robot, a reference and a loop."""
