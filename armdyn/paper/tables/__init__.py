"""Tables 3 to 7 of the paper: published beside ours, as rows, in its layout, on disk."""
