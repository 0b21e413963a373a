"""Control of an arm: sampled and continuous loops, controllers, stability at the goal."""

from typing import TYPE_CHECKING

from armdyn.lazy import facade

if TYPE_CHECKING:
    from armdyn.control.laws.computed_torque import ComputedTorque
    from armdyn.control.laws.lqr import Lqr
    from armdyn.control.laws.pid import Pid, PidGains
    from armdyn.control.loop.loop import Loop
    from armdyn.control.loop.references import ramp, set_point
    from armdyn.control.stability.margins import Margins, loop_margins, multiloop_disk
    from armdyn.control.stability.plane import GainPlane, gain_plane
    from armdyn.control.stability.poles import closed_loop_eigenvalues
    from armdyn.control.stability.rate import SampledStability, sampled_stability, slowest_stable_rate
    from armdyn.control.stability.region import GainRegion, least_stable_factor
    from armdyn.control.stability.routh import RouthTable, characteristic_polynomial, routh_table
    from armdyn.control.stability.sampled import SampledLoop, sampled_loop
    from armdyn.control.tracking.pid import simulate_pid
    from armdyn.control.tracking.run import Run
    from armdyn.control.tracking.track import track
else:
    __getattr__, __dir__ = facade(
        __name__,
        {
            "laws.computed_torque": "ComputedTorque",
            "laws.lqr": "Lqr",
            "laws.pid": "Pid PidGains",
            "loop.loop": "Loop",
            "loop.references": "ramp set_point",
            "stability.margins": "Margins loop_margins multiloop_disk",
            "stability.plane": "GainPlane gain_plane",
            "stability.poles": "closed_loop_eigenvalues",
            "stability.rate": "SampledStability sampled_stability slowest_stable_rate",
            "stability.region": "GainRegion least_stable_factor",
            "stability.routh": "RouthTable characteristic_polynomial routh_table",
            "stability.sampled": "SampledLoop sampled_loop",
            "tracking.pid": "simulate_pid",
            "tracking.run": "Run",
            "tracking.track": "track",
        },
    )

__all__ = [
    "ComputedTorque",
    "GainPlane",
    "GainRegion",
    "Loop",
    "Lqr",
    "Margins",
    "Pid",
    "PidGains",
    "RouthTable",
    "Run",
    "SampledLoop",
    "SampledStability",
    "characteristic_polynomial",
    "closed_loop_eigenvalues",
    "gain_plane",
    "least_stable_factor",
    "loop_margins",
    "multiloop_disk",
    "ramp",
    "routh_table",
    "sampled_loop",
    "sampled_stability",
    "set_point",
    "simulate_pid",
    "slowest_stable_rate",
    "track",
]
