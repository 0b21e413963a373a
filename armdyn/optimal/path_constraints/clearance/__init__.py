"""Clearance from obstacles and between the arm's own links."""
