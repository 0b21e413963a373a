"""Mesh refinement by doubling."""

from dataclasses import dataclass


@dataclass(frozen=True)
class MeshRefinement:
    """Meshes of which each has twice as many intervals as the one before.

    Attributes:
        finest: no mesh has more.
    """

    finest: int

    def above(self, intervals: int) -> int | None:
        """The next mesh; None at the top."""
        return 2 * intervals if 2 * intervals <= self.finest else None
