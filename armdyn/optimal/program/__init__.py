"""Motion as unknowns and equations: layout, one interval, the program of many, its derivatives."""
