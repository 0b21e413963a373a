"""What is asked: the motion, its limits, how a solve may end or be stopped."""
