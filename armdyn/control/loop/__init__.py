"""A loop as it is built: how it samples, what a reference is to it, and what a controller's law is."""
