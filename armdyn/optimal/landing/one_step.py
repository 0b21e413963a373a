"""One step of Dormand-Prince 8(5,3) from one sample of the torque to the next, which is nearly always enough.

Where the torque has a corner at every sample an integrator is started at every sample, and `scipy.integrate.DOP853`
takes longer to be started than to step. This is its step, by its own coefficients, without the object around it.
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import DOP853

Array = NDArray[np.float64]
Rate = Callable[[float, Array], Array]

_A, _B, _C, _E3, _E5 = (np.asarray(getattr(DOP853, name)) for name in ("A", "B", "C", "E3", "E5"))
_STAGES = int(DOP853.n_stages)
EVALUATIONS = _STAGES
"""Of the rate, in one step from where it is known."""


def one_step(rate: Rate, times: Array, x: Array, slope: Array, rtol: float) -> tuple[Array, Array] | None:
    """The state after a stretch, and its rate there.

    Args:
        rate: (time, state) ↦ how the state changes.
        times: the stretch's ends [s], shape (2,).
        x: the state where it begins, shape (m,).
        slope: the rate there, shape (m,).
        rtol: relative tolerance; absolute 1e-2 of that.

    Returns:
        None: the error is beyond the tolerance by the method's own estimate, or something is not finite.
    """
    start, end = times
    h = end - start
    K = np.empty((_STAGES + 1, x.size))
    K[0] = slope
    for s in range(1, _STAGES):
        K[s] = rate(start + _C[s] * h, x + h * (_A[s, :s] @ K[:s]))
    there = x + h * (_B @ K[:_STAGES])
    K[_STAGES] = rate(end, there)
    scale = rtol * (1e-2 + np.maximum(np.abs(x), np.abs(there)))
    fifth, third = _E5 @ K / scale, _E3 @ K / scale
    fine, coarse = float(fifth @ fifth), float(third @ third)
    error = 0.0 if fine == 0 else abs(h) * fine / np.sqrt((fine + 0.01 * coarse) * x.size)
    return (there, K[_STAGES]) if error < 1 else None  # NaN is not
