"""The solution of a minimum-time problem, and its description."""
