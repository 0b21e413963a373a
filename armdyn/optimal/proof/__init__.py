"""What is checked of an answer: Pontryagin, the certificate, sensitivities."""
