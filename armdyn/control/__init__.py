"""PID control of an arm: gains, closed-loop simulation, stability at the goal."""

from typing import TYPE_CHECKING

from armdyn.lazy import facade

if TYPE_CHECKING:
    from armdyn.control.pid.closed_loop import PidRun, simulate_pid
    from armdyn.control.pid.gains import PidGains
    from armdyn.control.pid.poles import closed_loop_eigenvalues
else:
    __getattr__, __dir__ = facade(
        __name__,
        {
            "pid.closed_loop": "PidRun simulate_pid",
            "pid.gains": "PidGains",
            "pid.poles": "closed_loop_eigenvalues",
        },
    )

__all__ = ["PidGains", "PidRun", "closed_loop_eigenvalues", "simulate_pid"]
