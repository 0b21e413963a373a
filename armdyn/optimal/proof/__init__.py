"""Verification of a solution: Pontryagin's conditions, adjoint equations, certificate, sensitivities."""
