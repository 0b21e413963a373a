"""Machine code of a program's derivatives: built once, kept, loaded; and how long that may take."""
