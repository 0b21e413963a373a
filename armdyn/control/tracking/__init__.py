"""What a controller makes of a reference on a real arm."""
