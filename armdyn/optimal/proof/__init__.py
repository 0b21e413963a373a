"""What is checked of an answer: Pontryagin, adjoint equations, the certificate; what decides its time."""
