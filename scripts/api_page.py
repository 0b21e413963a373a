"""Write docs/api.md: every exported name, with its signature and its first line, by subject.

python scripts/api_page.py
"""

import inspect
from pathlib import Path

import armdyn as ad

PAGE = Path(__file__).parents[1] / "docs" / "api.md"
SUBJECTS = {
    "Robots": "Robot RobotOptions ArmSpec LinkSpec Payload Tool JointLimits urdf_from_spec mujoco_model repair_urdf",
    "Scenes": "load_scene Scene Box Sphere Capsule Cylinder Plane Mesh Group PointCloud HeightMap plan_path",
    "Controllers of robots": "ControllerPreset ControllerCheck ControllerFamily",
    "Dynamics": "Dynamics replay_torques",
    "Minimum time": "MinimumTimeProblem read_problem RmsTorque FrameSpeedLimit TorqueRateLimit FrameRegion GoalPose "
    "MinimumTimeOptions solve_minimum_time solve_many Resolver Solution Status Arc Certificate Sensitivities "
    "lower_bound LowerBound time_optimality TimeOptimality trajectory_from_path build_mesh build_curve MotionProgram",
    "Cycles": "Cycle Move Straight Grasp Release Wait solve_cycle CycleSolution cycle_costs CycleCost read_cycle",
    "Identification": "identify IdentifyOptions Estimate Log exciting_motion ExcitingOptions",
    "Motions": "Trajectory Piece Load load_of reversed_motion Samples",
    "Closed loops": "track Run Loop Lqr ComputedTorque Pid PidGains ramp Ramps set_point simulate_pid",
    "Stability": "sampled_stability SampledStability slowest_stable_rate sampled_loop SampledLoop loop_margins Margins "
    "multiloop_disk gain_plane GainPlane GainRegion least_stable_factor closed_loop_eigenvalues "
    "characteristic_polynomial routh_table RouthTable",
    "Studies": "read_study run_study study_table dask_executor Parameter Sample reserve_curve ReserveCurve "
    "likely_plants monte_carlo MonteCarlo MonteCarloOptions Plants tune Tuned TuneOptions",
    "Errors": "ArmdynError ArmdynWarning ContactError CycleError LogError",
}
"""Exported names by subject; another name of `armdyn.__all__` is an error of this script's test."""
BESIDE = {"Robots": ("models.UrdfRepair", "models.InertiaRepair", "models.InertiaEstimate")}
"""Values that exported functions return, of a package of `armdyn`."""


def line(name: str) -> str:
    """A name with the names of its arguments (optional ones followed by "="), and its first line."""
    thing = getattr(ad, name)
    about = (inspect.getdoc(thing) or "").partition("\n")[0]
    if isinstance(thing, type) and issubclass(thing, Exception | Warning):
        return f"- `{name}`: {about}"
    arguments = inspect.signature(thing).parameters.values()
    shown = ", ".join(one.name + "=" * (one.default is not inspect.Parameter.empty) for one in arguments)
    return f"- `{name}({shown})`: {about}"


def page() -> str:
    """The page, in Markdown."""
    parts = ["# Python", "Everything is one import away: `import armdyn as ad`. `name=` is an optional argument."]
    for subject, names in SUBJECTS.items():
        own = names.split()
        parts += [f"## {subject}", "\n".join(line(name) for name in own)]
        parts.append("\n".join(f"::: armdyn.{name}" for name in (*own, *BESIDE.get(subject, ()))))
    return "\n\n".join(parts) + "\n"


if __name__ == "__main__":
    PAGE.write_text(page())
