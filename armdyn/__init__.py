"""Time-optimal and closed-loop motion of robot arms, from a URDF."""

from armdyn.errors import ArmdynError, ArmdynWarning
from armdyn.lazy import facade

TYPE_CHECKING = False  # as typing has it, which takes longer to import than all of this
if TYPE_CHECKING:
    from armdyn.control import (
        ComputedTorque,
        Loop,
        Lqr,
        Pid,
        PidGains,
        PidRun,
        Run,
        closed_loop_eigenvalues,
        ramp,
        set_point,
        simulate_pid,
        track,
    )
    from armdyn.dynamics import Dynamics
    from armdyn.models import (
        PAPER_PAYLOADS,
        ArmSpec,
        Box,
        Capsule,
        GoalPose,
        JointLimits,
        LinkSpec,
        Payload,
        Robot,
        Sphere,
        urdf_from_spec,
    )
    from armdyn.optimal import (
        Arc,
        Certificate,
        FrameSpeedLimit,
        LowerBound,
        MinimumTimeOptions,
        MinimumTimeProblem,
        Sensitivities,
        Solution,
        Status,
        TimeOptimality,
        TorqueRateLimit,
        lower_bound,
        replay_torques,
        solve_minimum_time,
        time_optimality,
        trajectory_from_path,
    )
    from armdyn.studies.paper.printed.loop import PAPER_GAINS
    from armdyn.studies.plants.monte_carlo import monte_carlo
    from armdyn.studies.plants.plants import Plants
    from armdyn.studies.plants.question import MonteCarloOptions
    from armdyn.studies.plants.result import MonteCarlo
    from armdyn.studies.tuning.families import ControllerFamily, Parameter, Ramps
    from armdyn.studies.tuning.tune import Tuned, TuneOptions, tune
    from armdyn.trajectory import Sample, Trajectory
else:
    __getattr__, __dir__ = facade(
        __name__,
        {
            "control": "ComputedTorque Loop Lqr Pid PidGains PidRun Run closed_loop_eigenvalues ramp "
            "set_point simulate_pid track",
            "dynamics": "Dynamics",
            "models": "PAPER_PAYLOADS ArmSpec Box Capsule GoalPose "
            "JointLimits LinkSpec Payload Robot Sphere urdf_from_spec",
            "optimal": "Arc Certificate FrameSpeedLimit LowerBound MinimumTimeOptions MinimumTimeProblem Sensitivities "
            "Solution Status TimeOptimality TorqueRateLimit "
            "lower_bound replay_torques solve_minimum_time time_optimality trajectory_from_path",
            "studies.paper.printed.loop": "PAPER_GAINS",
            "studies.plants.monte_carlo": "monte_carlo",
            "studies.plants.plants": "Plants",
            "studies.plants.question": "MonteCarloOptions",
            "studies.plants.result": "MonteCarlo",
            "studies.tuning.families": "ControllerFamily Parameter Ramps",
            "studies.tuning.tune": "TuneOptions Tuned tune",
            "trajectory": "Sample Trajectory",
        },
    )

__version__ = "0.1.0"

__all__ = [
    "PAPER_GAINS",
    "PAPER_PAYLOADS",
    "Arc",
    "ArmSpec",
    "ArmdynError",
    "ArmdynWarning",
    "Box",
    "Capsule",
    "Certificate",
    "ComputedTorque",
    "ControllerFamily",
    "Dynamics",
    "FrameSpeedLimit",
    "GoalPose",
    "JointLimits",
    "LinkSpec",
    "Loop",
    "LowerBound",
    "Lqr",
    "MinimumTimeOptions",
    "MinimumTimeProblem",
    "MonteCarlo",
    "MonteCarloOptions",
    "Parameter",
    "Payload",
    "Pid",
    "PidGains",
    "PidRun",
    "Plants",
    "Ramps",
    "Robot",
    "Run",
    "Sample",
    "Sensitivities",
    "Solution",
    "Sphere",
    "Status",
    "TimeOptimality",
    "TorqueRateLimit",
    "Trajectory",
    "TuneOptions",
    "Tuned",
    "__version__",
    "closed_loop_eigenvalues",
    "lower_bound",
    "monte_carlo",
    "ramp",
    "replay_torques",
    "set_point",
    "simulate_pid",
    "solve_minimum_time",
    "time_optimality",
    "track",
    "trajectory_from_path",
    "tune",
    "urdf_from_spec",
]
