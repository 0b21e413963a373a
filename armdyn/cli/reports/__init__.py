"""Commands that show what others have left on disk."""
