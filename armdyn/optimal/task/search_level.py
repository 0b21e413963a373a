"""Levels of search. Imports nothing, so that the command line can use it."""

from typing import Literal

SearchLevel = Literal["quick", "normal", "thorough"]
SEARCH_LEVELS: tuple[SearchLevel, ...] = ("quick", "normal", "thorough")
"""From the quickest on."""
