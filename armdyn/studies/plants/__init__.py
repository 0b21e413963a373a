"""One controller and many arms: how they differ from its model, what comes of each, and what is said of all of them."""
