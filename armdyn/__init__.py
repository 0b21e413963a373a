"""Time-optimal and closed-loop motion of robot arms, from a URDF."""

from armdyn.errors import ArmdynError, ArmdynWarning
from armdyn.lazy import facade

TYPE_CHECKING = False  # as typing has it, which takes longer to import than all of this
if TYPE_CHECKING:
    from armdyn.control import PidGains, PidRun, closed_loop_eigenvalues, simulate_pid
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
    from armdyn.trajectory import Sample, Samples, Trajectory
else:
    __getattr__, __dir__ = facade(
        __name__,
        {
            "control": "PidGains PidRun closed_loop_eigenvalues simulate_pid",
            "dynamics": "Dynamics",
            "models": "PAPER_PAYLOADS ArmSpec Box Capsule GoalPose "
            "JointLimits LinkSpec Payload Robot Sphere urdf_from_spec",
            "optimal": "Arc Certificate FrameSpeedLimit LowerBound MinimumTimeOptions MinimumTimeProblem Sensitivities "
            "Solution Status TimeOptimality TorqueRateLimit "
            "lower_bound replay_torques solve_minimum_time time_optimality trajectory_from_path",
            "studies.paper.printed.loop": "PAPER_GAINS",
            "trajectory": "Sample Samples Trajectory",
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
    "Dynamics",
    "FrameSpeedLimit",
    "GoalPose",
    "JointLimits",
    "LinkSpec",
    "LowerBound",
    "MinimumTimeOptions",
    "MinimumTimeProblem",
    "Payload",
    "PidGains",
    "PidRun",
    "Robot",
    "Sample",
    "Samples",
    "Sensitivities",
    "Solution",
    "Sphere",
    "Status",
    "TimeOptimality",
    "TorqueRateLimit",
    "Trajectory",
    "__version__",
    "closed_loop_eigenvalues",
    "lower_bound",
    "replay_torques",
    "simulate_pid",
    "solve_minimum_time",
    "time_optimality",
    "trajectory_from_path",
    "urdf_from_spec",
]
