"""What is left on disk of a run: trajectory, figure, replay and a summary, in one folder."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from armdyn.control import PidRun
from armdyn.models.obstacles import Obstacle
from armdyn.models.robot import Robot
from armdyn.optimal import Solution
from armdyn.show.plots import plot_trajectories, save_figure
from armdyn.show.replay import write_html
from armdyn.show.results import save_result
from armdyn.trajectory import Trajectory


def minimum_time_summary(solution: Solution) -> dict[str, object]:
    """A solution as JSON says it: numbers that are not finite are null, units as in `Solution`."""
    worst, certificate, by = solution.worst_violation, solution.certificate, solution.sensitivities()
    return {
        "success": solution.success,
        "status": str(solution.status),
        "message": solution.message,
        "duration": solution.duration,
        "certified": certificate.ok,
        "certificate": {
            "ok": certificate.ok,
            "goal_error": _finite(certificate.goal_error),
            "goal_velocity_error": _finite(certificate.goal_velocity_error),
            "hamiltonian_spread": _finite(certificate.hamiltonian_spread),
            "switching_violation": _finite(certificate.switching_violation),
            "limit_violation": _finite(certificate.limit_violation),
            "singular": certificate.singular,
            "reasons": list(certificate.reasons),
        },
        "replay_error": _finite(solution.replay_error),
        "replay_velocity_error": _finite(solution.replay_velocity_error),
        "arcs": [{"duration": arc.duration, "modes": [str(mode) for mode in arc.modes]} for arc in solution.arcs],
        "local_optima": list(solution.local_optima),
        "sensitivities": None
        if by is None
        else {
            "payload_mass": by.payload_mass,
            "effort_upper": by.effort_upper.tolist(),
            "effort_lower": by.effort_lower.tolist(),
            "velocity": by.velocity.tolist(),
        },
        "clearance": None
        if solution.clearance is None
        else {
            "distance": solution.clearance.distance,
            "time": solution.clearance.time,
            "body": solution.clearance.body,
            "other": solution.clearance.other,
            "sure": solution.clearance.sure,
        },
        "conditions": [
            {"name": kept.name, "share": kept.share, "said": kept.said, "reasons": list(kept.reasons)}
            for kept in solution.kept
        ],
        "q_goal": np.asarray(solution.problem.q_goal).tolist(),
        "via_times": list(solution.via_times),
        "goals": [{"q": goal.q.tolist(), "duration": _finite(goal.duration)} for goal in solution.goals],
        "intervals": solution.intervals,
        "iterations": solution.iterations,
        "solve_time": round(solution.solve_time, 3),
        "worst_violation": None if worst is None else str(worst),
    }


def pid_summary(run: PidRun) -> dict[str, object]:
    """A closed-loop run as JSON says it: success is that it arrived; units as in `PidRun`."""
    return {
        "success": run.arrival_time is not None,
        "status": str(run.status),
        "message": run.message,
        "arrival_time": run.arrival_time,
        "overshoot": [float(x) for x in run.overshoot],
        "max_real_eigenvalue": _finite(run.max_real_eigenvalue),
        "duration": run.trajectory.duration,
    }


def write_run(
    folder: Path,
    robot: Robot,
    trajectory: Trajectory,
    summary: dict[str, object],
    title: str,
    obstacles: Sequence[Obstacle] = (),
) -> list[Path]:
    """Write trajectory.npz, figure.png, figure.pdf, replay.html and result.json.

    Args:
        folder: made if it is not there.
        robot: that moved.
        trajectory: its motion.
        summary: what result.json says, besides the files.
        title: of the figure.
        obstacles: drawn in the replay.

    Returns:
        The files written.

    Raises:
        OSError: the folder cannot be written.
    """
    folder.mkdir(parents=True, exist_ok=True)
    trajectory = replace(trajectory, model_hash=robot.model_hash)
    files = [trajectory.save(folder / "trajectory.npz")]
    figure = plot_trajectories([trajectory], limits=robot.limits, title=title)
    files += [save_figure(figure, folder / f"figure.{suffix}") for suffix in ("png", "pdf")]
    files.append(write_html(robot, [trajectory], folder / "replay.html", obstacles=obstacles))
    result = folder / "result.json"
    names = [path.name for path in [*files, result]]
    return [*files, save_result(result, robot, {**summary, "files": names})]


def _finite(number: float) -> float | None:
    return number if abs(number) < float("inf") else None
