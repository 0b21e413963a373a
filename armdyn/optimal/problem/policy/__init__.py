"""Policy: everything that depends on the class of a problem, and the tuned numbers with unit, reason and cases."""
