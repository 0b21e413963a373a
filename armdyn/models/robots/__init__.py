"""Robots and their readers."""
