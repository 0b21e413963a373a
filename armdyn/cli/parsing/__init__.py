"""What people type: positions with units and names, problem files, and how help tells of options."""
