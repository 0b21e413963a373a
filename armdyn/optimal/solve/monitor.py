"""Asks within IPOPT whether to stop."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import casadi as ca

from armdyn.optimal.problem.stop import Stop


class Monitor(ca.Callback):
    """An iteration callback of `casadi.nlpsol` that asks a `Stop` while there is one."""

    def __init__(self, nx: int, ng: int, np_: int):
        ca.Callback.__init__(self)
        self._sizes = {"x": nx, "f": 1, "g": ng, "lam_x": nx, "lam_g": ng, "lam_p": np_}
        self._stop: Stop | None = None
        self.construct("monitor", {})

    @contextmanager
    def asking(self, stop: Stop) -> Iterator[None]:
        """Within it, and no longer, a `Stop` is asked."""
        self._stop = stop
        try:
            yield
        finally:
            self._stop = None

    def get_n_in(self) -> int:
        """The outputs of nlpsol are its inputs."""
        return int(ca.nlpsol_n_out())

    def get_n_out(self) -> int:
        """One: whether to stop."""
        return 1

    def get_name_in(self, i: int) -> str:
        """Name of an input, as nlpsol calls it."""
        return str(ca.nlpsol_out(i))

    def get_sparsity_in(self, i: int) -> ca.Sparsity:
        """Sparsity of each input: dense columns."""
        return ca.Sparsity.dense(self._sizes[ca.nlpsol_out(i)], 1)

    def eval(self, arguments: Any) -> list[int]:
        """Returns nonzero where IPOPT is to stop."""
        return [int(bool(self._stop))]
