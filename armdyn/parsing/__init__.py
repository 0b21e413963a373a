"""Parsing of user input: numbers and positions with units, TOML files."""
