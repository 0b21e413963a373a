"""Gains for a set of arms: families of controllers, their index, and the search for the best."""
