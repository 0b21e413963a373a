"""Where the knots of a mesh lie."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def mesh(intervals: int, graded: bool) -> Array:
    """Knots as parts of the duration, shape (intervals + 1,).

    Args:
        intervals: their number N.
        graded: dense at both ends, for ramps to and from rest that are a thousandth of the motion; else even.
    """
    even = np.linspace(0, 1, intervals + 1)
    return 0.3 * even + 0.35 * (1 - np.cos(np.pi * even)) if graded else even
