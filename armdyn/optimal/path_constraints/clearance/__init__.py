"""Keeping clear of obstacles, and of oneself."""
