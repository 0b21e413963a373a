"""What figures share: colours and lines, and limits in panels."""
