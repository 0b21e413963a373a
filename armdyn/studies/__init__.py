"""Whole studies: the paper, reproduced."""
