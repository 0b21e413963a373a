"""Whole studies: the paper's examples."""
