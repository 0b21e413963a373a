"""Names of levels of search and of methods. Imports nothing, for the command line."""

from typing import Literal

SearchLevel = Literal["quick", "normal", "thorough"]
SEARCH_LEVELS: dict[SearchLevel, float] = {"quick": 1 / 3, "normal": 1.0, "thorough": 5.0}
"""Levels from the quickest on, and their numbers of guesses as multiples of the normal one."""
MethodName = Literal["mesh", "curves", "profiles"]
METHOD_NAMES: tuple[MethodName, ...] = ("mesh", "curves", "profiles")
"""Methods: collocation, B-splines with inverse dynamics, every joint's own fastest profile."""
