"""Limits along the way: of accelerations and jerks, of how fast torques change and frames move."""
