"""The paper as printed: examples, equations, PID loop, published numbers."""
