"""How much is searched: a word for what is worth the wait. It imports nothing, so that the command line may know it."""

from typing import Literal

SearchLevel = Literal["quick", "normal", "thorough"]
SEARCH_LEVELS: tuple[SearchLevel, ...] = ("quick", "normal", "thorough")
"""From the quickest on."""
