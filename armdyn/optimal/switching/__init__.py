"""Switching structures: extremals by shooting, and corrections of the structure by the costates."""
