"""CasADi Functions as machine code: generated, compiled, cached, loaded."""
