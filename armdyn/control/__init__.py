"""Control of an arm: loops as they are built, controllers, the paper's PID loop and its stability at the goal."""

from typing import TYPE_CHECKING

from armdyn.lazy import facade

if TYPE_CHECKING:
    from armdyn.control.laws.computed_torque import ComputedTorque
    from armdyn.control.laws.lqr import Lqr
    from armdyn.control.laws.pid import Pid
    from armdyn.control.loop.loop import Loop
    from armdyn.control.loop.references import ramp, set_point
    from armdyn.control.pid.closed_loop import PidRun, simulate_pid
    from armdyn.control.pid.gains import PidGains
    from armdyn.control.pid.poles import closed_loop_eigenvalues
    from armdyn.control.tracking.run import Run
    from armdyn.control.tracking.track import track
else:
    __getattr__, __dir__ = facade(
        __name__,
        {
            "laws.computed_torque": "ComputedTorque",
            "laws.lqr": "Lqr",
            "laws.pid": "Pid",
            "loop.loop": "Loop",
            "loop.references": "ramp set_point",
            "pid.closed_loop": "PidRun simulate_pid",
            "pid.gains": "PidGains",
            "pid.poles": "closed_loop_eigenvalues",
            "tracking.run": "Run",
            "tracking.track": "track",
        },
    )

__all__ = [
    "ComputedTorque",
    "Loop",
    "Lqr",
    "Pid",
    "PidGains",
    "PidRun",
    "Run",
    "closed_loop_eigenvalues",
    "ramp",
    "set_point",
    "simulate_pid",
    "track",
]
