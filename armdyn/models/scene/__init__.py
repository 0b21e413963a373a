"""The scene of an arm: its bodies, obstacles and goals, and the distances between them."""
