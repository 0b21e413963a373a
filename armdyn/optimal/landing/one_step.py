"""One step of Dormand-Prince 8(5,3) from one sample of the torque to the next, which is nearly always enough.

Where the torque has a corner at every sample an integrator is started at every sample, and `scipy.integrate.DOP853`
takes longer to be started than to step. This is its step, by its own coefficients, without the object around it.
"""

import numpy as np
from scipy.integrate import DOP853

from armdyn.arrays import Array
from armdyn.dynamics.numeric import StateFunction

_A, _B, _C, _E3, _E5 = (np.asarray(getattr(DOP853, name)) for name in ("A", "B", "C", "E3", "E5"))
_STAGES = int(DOP853.n_stages)
EVALUATIONS = _STAGES
"""Of the acceleration, in one step from where it is known."""
NODES = np.append(_C[:_STAGES], 1.0)[:, None]
"""Where a step asks for torques, as parts of it, shape (EVALUATIONS + 1, 1)."""
_BEFORE = tuple(_A[s, :s] for s in range(_STAGES))


def at_nodes(tau: Array) -> Array:
    """Torques where a step asks for them, from those at its start and its end, shape (2, nv).

    At the end they are those given, to the bit, so that a step begun there anew is the same as one that goes on.
    """
    torques: Array = tau[0] + NODES * (tau[1] - tau[0])
    torques[-1] = tau[1]
    return torques


def one_step(
    acceleration: StateFunction, torques: Array, h: float, x: Array, slope: Array, rtol: float
) -> tuple[Array, Array] | None:
    """The state after a stretch, and its rate there.

    Args:
        acceleration: of q, v and tau.
        torques: see `at_nodes`, shape (EVALUATIONS + 1, nv).
        h: its length [s].
        x: (q, v) where it begins, shape (2 nv,).
        slope: its rate there, shape (2 nv,).
        rtol: relative tolerance; absolute 1e-2 of that.

    Returns:
        None: the error is beyond the tolerance by the method's own estimate, or something is not finite.
    """
    n = x.size // 2
    K = np.empty((_STAGES + 1, x.size))
    K[0] = slope
    for s in range(1, _STAGES):
        y = x + h * (_BEFORE[s] @ K[:s])
        K[s, :n], K[s, n:] = y[n:], acceleration(y[:n], y[n:], torques[s])
    there = x + h * (_B @ K[:_STAGES])
    K[_STAGES, :n], K[_STAGES, n:] = there[n:], acceleration(there[:n], there[n:], torques[_STAGES])
    scale = rtol * (1e-2 + np.maximum(np.abs(x), np.abs(there)))
    fifth, third = _E5 @ K / scale, _E3 @ K / scale
    fine, coarse = float(fifth @ fifth), float(third @ third)
    error = 0.0 if fine == 0 else abs(h) * fine / np.sqrt((fine + 0.01 * coarse) * x.size)
    return (there, K[_STAGES]) if error < 1 else None  # NaN is not
