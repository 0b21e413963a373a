"""Guesses, many solves of them, the different optima that they lead to."""
