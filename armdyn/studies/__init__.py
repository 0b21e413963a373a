"""Studies of many cases: sweeps, Monte Carlo over plants, tuning, settled time over reserve."""
