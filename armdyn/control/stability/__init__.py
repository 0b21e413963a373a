"""Whether a loop is stable at its goal: Routh's table, gain regions, the sampled loop's matrix, margins and rates."""
