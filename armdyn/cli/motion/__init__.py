"""Commands that move a robot: mintime, pid, sweep, replay."""
