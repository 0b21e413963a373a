"""From a mesh's motion to exact switching times, where every torque is on a limit."""
