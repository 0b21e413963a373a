"""The double integrator for shooting: problem and guess."""

import numpy as np

from armdyn.optimal.problem.status import Stop
from armdyn.optimal.verify.arc import Arc, Mode
from armdyn.paper.indirect.bang_bang import BangBangExtremal, BangBangProblem
from armdyn.paper.indirect.canonical import canonical_system
from problems import cart


def cart_bang_bang():
    """The double integrator over 2 m: t_f = 2 √2 s, with a switch in the middle."""
    ends = np.array([0.0, 0.0]), np.array([2.0, 0.0])
    return BangBangProblem(canonical_system(cart()), *ends, np.array([-1.0]), np.array([1.0]), 1e-10, Stop())


def cart_guess(modes=(Mode.UPPER, Mode.LOWER), durations=(1.0, 2.0)):
    """A poor guess of its arcs."""
    arcs = tuple(Arc(d, (mode,)) for d, mode in zip(durations, modes, strict=True))
    return BangBangExtremal(arcs, (0,), np.array([[0.0, 0.0, -1.0, -1.0], [1.0, 1.0, -1.0, 0.0]]))
