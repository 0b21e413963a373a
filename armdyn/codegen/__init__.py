"""Functions as machine code: built once, kept, loaded; and how long that may take."""
