"""What is done in a case: the fastest motion, or a controller's."""
