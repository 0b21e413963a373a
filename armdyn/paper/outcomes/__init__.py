"""Cases of the paper, their outcomes, and the store of outcomes on disk. Nothing is drawn here."""
