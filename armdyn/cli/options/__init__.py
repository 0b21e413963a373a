"""The options that commands share, in groups, and what is made of them."""
