"""Path constraints, one class in one file each."""
