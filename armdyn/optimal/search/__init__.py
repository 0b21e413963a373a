"""Global search: initial guesses, multistart, distinct local optima."""
