"""Enclosures of values over boxes: intervals, affine forms, and CasADi Functions evaluated in both."""
