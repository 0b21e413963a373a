"""Names of levels of search and of methods. Imports nothing, for the command line."""

from typing import Literal

SearchLevel = Literal["quick", "normal", "thorough"]
SEARCH_LEVELS: tuple[SearchLevel, ...] = ("quick", "normal", "thorough")
"""Levels from the quickest on."""
MethodName = Literal["mesh", "curves", "profiles"]
METHOD_NAMES: tuple[MethodName, ...] = ("mesh", "curves", "profiles")
"""Methods: collocation, B-splines with inverse dynamics, every joint's own fastest profile."""
