"""What an arm is among: its own bodies, obstacles, goals, and how far it is from them."""
