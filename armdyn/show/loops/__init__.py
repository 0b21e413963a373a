"""Figures of closed loops: what a reserve gains, where gains are stable, how far many arms stray."""
