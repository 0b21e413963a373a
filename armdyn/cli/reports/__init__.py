"""Commands that show saved results."""
