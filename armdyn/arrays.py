"""Types of arrays: numbers, indices, truth values."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Index = NDArray[np.int_]
Flags = NDArray[np.bool_]
