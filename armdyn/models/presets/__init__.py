"""Controller presets: the conditions that robots' controllers put on commanded motions, and the check of a motion."""
