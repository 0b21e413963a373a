"""Commands of motions: mintime, cycle, bound, optimality, check, pid."""
