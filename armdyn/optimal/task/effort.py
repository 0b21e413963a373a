"""How much is searched: a word for what is worth the wait. It imports nothing, so that the command line may know it."""

from typing import Literal

Effort = Literal["quick", "normal", "thorough"]
EFFORTS: tuple[Effort, ...] = ("quick", "normal", "thorough")
"""From the quickest on."""
