"""Replay of torques through forward dynamics: limit violations, terminal correction, time scaling."""
