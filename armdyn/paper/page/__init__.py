"""Figures 2 to 7, a folder for each example, and one page of all results."""
