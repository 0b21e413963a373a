"""Collision-free joint paths."""
