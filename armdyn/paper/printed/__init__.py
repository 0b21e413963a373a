"""What the paper prints, as it stands there: examples, equations, its PID loop, published numbers."""
