"""A proven lower bound: how fast no motion within the limits can be, from momentum and interval arithmetic."""
