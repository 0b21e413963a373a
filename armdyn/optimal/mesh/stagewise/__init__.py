"""Stagewise interior-point method for the condensed program, in C."""
