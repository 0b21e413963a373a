"""What people type: numbers and positions in options and files, and files of TOML."""
