"""Sweeps: thousands of cases of one study, side by side, each a row on disk as soon as it ends."""
