"""Motions as B-splines: torques by inverse dynamics, so that the equations of motion hold by construction."""
