"""Controllers: values that compile to a law for a robot, a reference and a loop."""
