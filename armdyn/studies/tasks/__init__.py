"""Work on a case: the fastest motion, or a controller's."""
