"""Limits along the path: of accelerations, jerks, torque rates and frame speeds."""
