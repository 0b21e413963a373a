"""Gains for a set of arms: what may be chosen, what a choice is worth, and the search for the best."""
