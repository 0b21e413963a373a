"""Motion as a curve: B-splines for the positions, inverse dynamics for the torques; no equation of motion to break."""
