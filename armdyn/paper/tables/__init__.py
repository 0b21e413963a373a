"""Tables 3 to 7 of the paper, published against computed: as rows, in its layout, on disk."""
