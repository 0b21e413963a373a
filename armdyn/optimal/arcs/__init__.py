"""Which limit every joint is on, and from when to when: arcs read, corrected, solved for their durations."""
