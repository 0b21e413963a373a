"""Nonlinear programs of direct collocation: layout, one interval, assembly, derivatives."""
