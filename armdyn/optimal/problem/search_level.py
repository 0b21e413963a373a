"""Levels of search. Imports nothing, for the command line."""

from typing import Literal

SearchLevel = Literal["quick", "normal", "thorough"]
SEARCH_LEVELS: tuple[SearchLevel, ...] = ("quick", "normal", "thorough")
"""Levels from the quickest on."""
