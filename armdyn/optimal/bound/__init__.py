"""Lower bound on the duration, proven by the momentum equation and interval arithmetic."""
