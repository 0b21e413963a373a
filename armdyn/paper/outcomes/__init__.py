"""One thing to solve or simulate, what comes of it, and how that is kept on disk. Nothing is drawn here."""
