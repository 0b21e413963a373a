"""The condensed program solved interval by interval: an interior-point method of our own, in C."""
