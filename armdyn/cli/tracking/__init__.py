"""Commands about what a controller makes of a motion."""
