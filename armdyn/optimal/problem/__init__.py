"""The minimum-time problem: poses, limits, path constraints; statuses and stopping."""
