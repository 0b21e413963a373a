"""Commands that move one robot: mintime, pid, replay."""

import warnings
from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from rich.markup import escape

from armdyn.cli.arguments import (
    AccelerationLimit,
    Armature,
    ClearanceOption,
    Damping,
    EffortLimit,
    Friction,
    FrictionWidth,
    GoalPoseOption,
    JerkLimit,
    Json,
    Lock,
    Obstacles,
    Out,
    Part,
    PayloadCom,
    PayloadFrame,
    PayloadMass,
    QGoal,
    QStart,
    RobotName,
    SelfCollision,
    VelocityLimit,
    Via,
    Wrap,
    carried,
    friction_facts,
    friction_words,
    goal_pose_of,
    load_robot,
    number,
    numbers,
    obstacles_of,
    one_or_more,
    poses,
    slug,
)
from armdyn.cli.conditions import Limits, limit_words, limits_of
from armdyn.cli.console import INTERRUPTED, NOT_CERTIFIED, answering, console, facts_table, working
from armdyn.errors import ArmdynWarning, ProblemError, TrajectoryError
from armdyn.optimal import Solution
from armdyn.optimal.problem.turns import endless
from armdyn.trajectory import Trajectory


def mintime(
    robot: RobotName,
    q_start: QStart = None,
    q_goal: QGoal = None,
    payload: PayloadMass = 0.0,
    payload_frame: PayloadFrame = None,
    payload_com: PayloadCom = None,
    lock: Lock = None,
    part: Part = None,
    effort_limit: EffortLimit = None,
    velocity_limit: VelocityLimit = None,
    damping: Damping = None,
    friction: Friction = None,
    friction_width: FrictionWidth = None,
    armature: Armature = None,
    wrap: Wrap = False,
    goal_pose: GoalPoseOption = None,
    via: Via = None,
    obstacle: Obstacles = None,
    self_collision: SelfCollision = False,
    clearance: ClearanceOption = 0.005,
    acceleration_limit: AccelerationLimit = None,
    jerk_limit: JerkLimit = None,
    limit: Limits = None,
    starts: Annotated[
        int | None, typer.Option(help="Guesses of the global search; by default 1 to 48, by the joints.")
    ] = None,
    time_limit: Annotated[float, typer.Option(metavar="S", help="For the whole solve \\[s].")] = 300.0,
    seed: Annotated[int, typer.Option(help="Of the guesses after the first.")] = 0,
    out: Out = None,
    json: Json = False,
) -> None:
    """Fastest motion between two poses that the actuators allow.

    Searches many guesses, resolves the best to exact switching times, replays the torques through
    Pinocchio's forward dynamics by an independent integrator, and checks Pontryagin's conditions.
    Exit code 0 means certified; 3 that something of this failed, and the output says what.

    With obstacles, via points or limits along the way the answer is the collocation's, replayed and
    checked all along; the switching times are then not resolved, so that its exit code is 3, too.

    [dim]armdyn mintime rr --payload 0.1006
    armdyn mintime rr --obstacle sphere:0.05@0.3,0,-0.1
    armdyn mintime rr --limit tip-speed=2 --limit torque-rate=50
    armdyn mintime rr --goal-pose tip:0.35,0,0.1
    armdyn mintime panda --q-start 0,-0.785,0,-2.356,0,1.571,0.785 --q-goal 1,0.2,0.5,-1.5,0.3,2,-0.5[/]
    """
    with answering(json) as answer:
        from armdyn.optimal import MinimumTimeOptions, MinimumTimeProblem, Status, solve_minimum_time
        from armdyn.show.report import minimum_time_summary, write_run

        load = carried(payload, payload_frame, payload_com)
        arm = load_robot(
            robot, load, lock, effort_limit, velocity_limit, damping, friction, friction_width, armature, part
        )
        posed = None if goal_pose is None else goal_pose_of(goal_pose)
        start, *goal = poses(arm, robot, "minimum_time", q_start, q_goal, posed=posed is not None)
        problem = MinimumTimeProblem(
            arm,
            q_start=start,
            q_goal=goal[0] if goal else None,
            goal_pose=posed,
            wrap=wrap,
            via=[numbers(text, "--via") for text in via or ()],
            obstacles=obstacles_of(obstacle),
            self_collision=self_collision,
            clearance=clearance,
            acceleration_limit=one_or_more(acceleration_limit, "--acceleration-limit"),
            jerk_limit=one_or_more(jerk_limit, "--jerk-limit"),
            conditions=limits_of(limit),
        )
        options = MinimumTimeOptions(starts=starts, time_limit=time_limit, seed=seed)
        with working(f"minimum time of {arm.name}", json) as progress:
            solution = solve_minimum_time(problem, options, progress)
            progress("figure and replay")
            folder = out or Path("results") / f"mintime-{slug(robot)}"
            title = f"{arm.name}, {1000 * payload:g} g: minimum time {solution.duration:.4f} s"
            summary = minimum_time_summary(solution)
            files = write_run(folder, arm, solution.trajectory, summary, title, problem.obstacles)
        answer.facts |= {"robot": arm.name, **friction_facts(arm), **summary, "files": [str(file) for file in files]}
        if not (solution.success and solution.certificate.ok):
            answer.code = INTERRUPTED if solution.status is Status.INTERRUPTED else NOT_CERTIFIED
        if not json:
            console.print(
                facts_table(
                    f"{arm.name}: minimum time", friction_words(arm) | _facts(solution, folder) | _turns(solution, wrap)
                )
            )


def _turns(solution: Solution, wrap: bool) -> dict[str, str]:
    """How far endless joints turn, where another way round was open or was taken."""
    problem = solution.problem
    away = np.asarray(problem.q_goal) - np.asarray(problem.q_start)
    far = [
        f"{name} turns {angle:.4g} rad"
        for name, angle, turns in zip(
            problem.robot.joint_names, away, endless(problem.robot, problem.limits), strict=True
        )
        if turns and (wrap or abs(angle) > np.pi)
    ]
    hint = "" if wrap else ", as it was asked to; with --wrap it may go the other way round"
    return {"way round": ", ".join(far) + hint} if far else {}


def _facts(solution: Solution, folder: Path) -> dict[str, str]:
    """A solution in words."""
    certificate, by = solution.certificate, solution.sensitivities()
    facts = {"status": str(solution.status) if solution.success else solution.message}
    facts["duration"] = f"{solution.duration:.9f} s"
    facts["replay"] = (
        f"{certificate.goal_error:.1e} rad and {certificate.goal_velocity_error:.1e} rad/s beside the goal"
    )
    facts["certificate"] = "yes" if certificate.ok else "NO: " + "; ".join(certificate.reasons)
    if solution.clearance is not None:
        proof = "nothing is missed between looks" if solution.clearance.sure else "looked at 10,000 times at most"
        facts["nearest"] = f"{solution.clearance} ({proof})"
    facts |= limit_words(solution)
    if solution.via_times:
        facts["via points"] = "at " + ", ".join(f"{t:.4f}" for t in solution.via_times) + " s"
    if solution.goals:
        facts["goals tried"] = (
            ", ".join(f"{goal.duration:.4f}{'' if goal.refined else ' (coarse)'}" for goal in solution.goals[:8]) + " s"
        )
        facts["goal"] = ", ".join(f"{x:.4f}" for x in np.asarray(solution.problem.q_goal)) + " rad"
    if solution.arcs:
        facts["Pontryagin"] = (
            f"|H| ≤ {certificate.hamiltonian_spread:.1e}, wrong signs ≤ {certificate.switching_violation:.1e}, "
            f"{len(solution.arcs)} arcs"
        )
    if solution.local_optima:
        others = ", ".join(f"{x:.4f}" for x in solution.local_optima[:5])
        facts["other optima"] = f"{others}{' …' if len(solution.local_optima) > 5 else ''} s"
    if by is not None:
        most, saved = by.limited_most_by(solution.problem)
        facts["limited most by"] = f"{most}: 1 % more saves {1e3 * saved:.3g} ms"
        facts["payload"] = f"1 g more at the tip costs {by.payload_mass:.3g} ms"
    facts["solved in"] = f"{solution.solve_time:.1f} s, {solution.iterations} iterations"
    facts["results"] = str(folder)
    return facts


def pid(
    robot: RobotName,
    q_start: QStart = None,
    q_goal: QGoal = None,
    payload: PayloadMass = 0.0,
    payload_frame: PayloadFrame = None,
    payload_com: PayloadCom = None,
    lock: Lock = None,
    part: Part = None,
    effort_limit: EffortLimit = None,
    damping: Damping = None,
    friction: Friction = None,
    friction_width: FrictionWidth = None,
    armature: Armature = None,
    gains: Annotated[str, typer.Option(metavar="KP,KI,KD", help="The same for every joint.")] = "30,50,10",
    form: Annotated[
        str,
        typer.Option(
            help="acceleration (the paper's), torque (a real controller, saturated), or computed_torque.",
        ),
    ] = "acceleration",
    duration: Annotated[float, typer.Option(metavar="S", help="How long to simulate \\[s].")] = 10.0,
    out: Out = None,
    json: Json = False,
) -> None:
    """What a PID loop does between two poses.

    [dim]armdyn pid rr --payload 0.1006
    armdyn pid rr --form torque --gains 30,50,3[/]
    """
    with answering(json) as answer:
        from armdyn.control import PidGains, simulate_pid
        from armdyn.show.report import pid_summary, write_run

        load = carried(payload, payload_frame, payload_com)
        arm = load_robot(robot, load, lock, effort_limit, None, damping, friction, friction_width, armature, part)
        start, goal = poses(arm, robot, "pid", q_start, q_goal)
        values = numbers(gains, "--gains")
        if len(values) != 3:
            raise ProblemError(f"--gains: {gains!r} has {len(values)} numbers; give three, KP,KI,KD")
        with working(f"PID loop of {arm.name}", json) as progress:
            run = simulate_pid(
                arm,
                q_start=start,
                q_goal=goal,
                gains=PidGains(kp=values[0], ki=values[1], kd=values[2]),
                duration=duration,
                form=form,  # type: ignore[arg-type]  # simulate_pid refuses what it does not know
            )
            progress("figure and replay")
            folder = out or Path("results") / f"pid-{slug(robot)}"
            summary = pid_summary(run)
            title = f"{arm.name}, {1000 * payload:g} g: PID loop"
            files = write_run(folder, arm, run.trajectory, summary, title)
        answer.facts |= {"robot": arm.name, **friction_facts(arm), **summary, "files": [str(file) for file in files]}
        answer.code = 0 if run.arrival_time is not None else NOT_CERTIFIED
        if not json:
            arrival = "-" if run.arrival_time is None else f"{run.arrival_time:.4f} s"
            console.print(
                facts_table(
                    f"{arm.name}: PID loop",
                    friction_words(arm)
                    | {
                        "status": f"{run.status}: {run.message}",
                        "arrival": arrival,
                        "overshoot": ", ".join(f"{x:.4f}" for x in run.overshoot) + " rad",
                        "max Re λ": f"{run.max_real_eigenvalue:.4f} 1/s",
                        "results": str(folder),
                    },
                )
            )


def replay(
    robot: RobotName,
    trajectories: Annotated[list[Path], typer.Argument(metavar="FILE.npz…", help="What mintime and pid wrote.")],
    payload: PayloadMass = 0.0,
    payload_frame: PayloadFrame = None,
    payload_com: PayloadCom = None,
    lock: Lock = None,
    part: Part = None,
    slow_motion: Annotated[
        str | None, typer.Option(metavar="X", help="Seconds shown per second of motion; by default it is chosen.")
    ] = None,
    out: Out = None,
    json: Json = False,
) -> None:
    """One self-contained HTML page in which the robot moves; several files move side by side.

    [dim]armdyn replay rr results/mintime-rr/trajectory.npz results/pid-rr/trajectory.npz --payload 0.1006[/]
    """
    with answering(json) as answer:
        from armdyn.show.replay import write_html

        arm = load_robot(robot, carried(payload, payload_frame, payload_com), lock, part=part)
        motions = [Trajectory.load(path) for path in trajectories]
        for path, motion in zip(trajectories, motions, strict=True):
            if motion.q.shape[1] != arm.nv:
                raise TrajectoryError(f"{path}: moves {motion.q.shape[1]} joints, {arm.name} has {arm.nv}")
            if motion.model_hash not in ("", arm.model_hash):
                warnings.warn(f"{path}: was computed for another arm, payload or friction", ArmdynWarning, stacklevel=2)
        folder = out or Path("results") / f"replay-{slug(robot)}"
        folder.mkdir(parents=True, exist_ok=True)
        slow = None if slow_motion is None else number(slow_motion, "--slow-motion")
        with working(f"replay of {arm.name}", json):
            page = write_html(arm, motions, folder / "replay.html", slow_motion=slow)
        answer.facts |= {"success": True, "status": "written", "files": [str(page)]}
        if not json:
            console.print(f"{escape(str(page))}  ({page.stat().st_size / 1e6:.1f} MB, opens in any browser)")
