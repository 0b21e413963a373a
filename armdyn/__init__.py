"""Time-optimal and closed-loop motion of robot arms, from a URDF."""

from armdyn.errors import ArmdynError, ArmdynWarning
from armdyn.lazy import facade
from armdyn.rendering import Renderer, register_renderer

TYPE_CHECKING = False  # as typing has it, which takes longer to import than all of this
if TYPE_CHECKING:
    from armdyn.control import (
        ComputedTorque,
        GainPlane,
        GainRegion,
        Loop,
        Lqr,
        Margins,
        Pid,
        PidGains,
        RouthTable,
        Run,
        SampledLoop,
        SampledStability,
        characteristic_polynomial,
        closed_loop_eigenvalues,
        gain_plane,
        least_stable_factor,
        loop_margins,
        multiloop_disk,
        ramp,
        routh_table,
        sampled_loop,
        sampled_stability,
        set_point,
        simulate_pid,
        slowest_stable_rate,
        track,
    )
    from armdyn.dynamics import Dynamics
    from armdyn.models import (
        ArmSpec,
        Box,
        Capsule,
        Cylinder,
        GoalPose,
        JointLimits,
        LinkSpec,
        Payload,
        Plane,
        Robot,
        RobotOptions,
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
        plan_path,
        read_problem,
        replay_torques,
        solve_minimum_time,
        time_optimality,
        trajectory_from_path,
    )
    from armdyn.studies.executors.dask_cluster import dask_executor
    from armdyn.studies.monte_carlo import monte_carlo
    from armdyn.studies.monte_carlo_result import MonteCarlo
    from armdyn.studies.plant_study import MonteCarloOptions
    from armdyn.studies.plants import Plants
    from armdyn.studies.reading import read_study
    from armdyn.studies.reserve import ReserveCurve, likely_plants, reserve_curve
    from armdyn.studies.run import run_study
    from armdyn.studies.tables import study_table
    from armdyn.studies.tuning.families import ControllerFamily, Parameter, Ramps
    from armdyn.studies.tuning.tune import Tuned, TuneOptions, tune
    from armdyn.trajectory import Sample, Samples, Trajectory
else:
    __getattr__, __dir__ = facade(
        __name__,
        {
            "control": "ComputedTorque GainPlane GainRegion Loop Lqr Margins Pid PidGains RouthTable "
            "Run SampledLoop SampledStability characteristic_polynomial closed_loop_eigenvalues "
            "gain_plane least_stable_factor loop_margins multiloop_disk ramp routh_table "
            "sampled_loop sampled_stability set_point simulate_pid slowest_stable_rate track",
            "dynamics": "Dynamics",
            "models": "ArmSpec Box Capsule Cylinder GoalPose JointLimits LinkSpec Payload Plane Robot RobotOptions "
            "Sphere urdf_from_spec",
            "optimal": "Arc Certificate FrameSpeedLimit LowerBound MinimumTimeOptions MinimumTimeProblem Sensitivities "
            "Solution Status TimeOptimality TorqueRateLimit "
            "lower_bound plan_path read_problem replay_torques solve_minimum_time time_optimality trajectory_from_path",
            "studies.monte_carlo": "monte_carlo",
            "studies.plants": "Plants",
            "studies.plant_study": "MonteCarloOptions",
            "studies.monte_carlo_result": "MonteCarlo",
            "studies.executors.dask_cluster": "dask_executor",
            "studies.tables": "study_table",
            "studies.reading": "read_study",
            "studies.run": "run_study",
            "studies.tuning.families": "ControllerFamily Parameter Ramps",
            "studies.tuning.tune": "TuneOptions Tuned tune",
            "studies.reserve": "ReserveCurve likely_plants reserve_curve",
            "trajectory": "Sample Samples Trajectory",
        },
    )


def _renderer() -> Renderer:
    from armdyn.show import values

    return values


register_renderer(_renderer)

__version__ = "0.2.0"

__all__ = [
    "Arc",
    "ArmSpec",
    "ArmdynError",
    "ArmdynWarning",
    "Box",
    "Capsule",
    "Certificate",
    "ComputedTorque",
    "ControllerFamily",
    "Cylinder",
    "Dynamics",
    "FrameSpeedLimit",
    "GainPlane",
    "GainRegion",
    "GoalPose",
    "JointLimits",
    "LinkSpec",
    "Loop",
    "LowerBound",
    "Lqr",
    "Margins",
    "MinimumTimeOptions",
    "MinimumTimeProblem",
    "MonteCarlo",
    "MonteCarloOptions",
    "Parameter",
    "Payload",
    "Pid",
    "PidGains",
    "Plane",
    "Plants",
    "Ramps",
    "ReserveCurve",
    "Robot",
    "RobotOptions",
    "RouthTable",
    "Run",
    "Sample",
    "SampledLoop",
    "SampledStability",
    "Samples",
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
    "characteristic_polynomial",
    "closed_loop_eigenvalues",
    "dask_executor",
    "gain_plane",
    "least_stable_factor",
    "likely_plants",
    "loop_margins",
    "lower_bound",
    "monte_carlo",
    "multiloop_disk",
    "plan_path",
    "ramp",
    "read_problem",
    "read_study",
    "replay_torques",
    "reserve_curve",
    "routh_table",
    "run_study",
    "sampled_loop",
    "sampled_stability",
    "set_point",
    "simulate_pid",
    "slowest_stable_rate",
    "solve_minimum_time",
    "study_table",
    "time_optimality",
    "track",
    "trajectory_from_path",
    "tune",
    "urdf_from_spec",
]
