"""Groups of options that commands share, and their values."""
