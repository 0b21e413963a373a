"""What holds every value over a box: intervals, affine forms, and CasADi Functions evaluated in them."""
