"""A session of the studio without its page: state, inverse kinematics, problem, motion, files."""

import json
import time
from collections.abc import Mapping
from contextlib import ExitStack
from dataclasses import dataclass, replace
from pathlib import Path
from types import TracebackType
from typing import Any, Literal, Self

import numpy as np
import pinocchio as pin

from armdyn.arguments import shown
from armdyn.errors import ArmdynError, ContactError, FileError, ProblemError
from armdyn.files import read_json, write_whole
from armdyn.models.presets.preset import ControllerPreset
from armdyn.models.scene.obstacles import Obstacle
from armdyn.models.scene.reaching import GoalPose, approached, frame_placement
from armdyn.optimal.answer.solution import Solution
from armdyn.optimal.minimum_time import solve_minimum_time
from armdyn.optimal.problem.options import MinimumTimeOptions
from armdyn.optimal.problem.problem import MinimumTimeProblem
from armdyn.show.studio.solving import NewestFirst
from armdyn.show.studio.state import StudioState, carrying, fitting_presets, problem_of, slider_limits

End = Literal["start", "goal"]
END_NAMES: tuple[End, End] = ("start", "goal")
STATE_FILE, PROBLEM_FILE, MOTION_FILE, REPORT_FILE = "studio.json", "problem.toml", "trajectory.npz", "report.html"
"""Files of a session in its folder."""

_FORMAT = "armdyn-studio-1"
_MAX_BYTES = 2**20
"""Of a saved state [bytes]."""
_SAVED = 0.5
"""Longest time until a changed state is saved [s]: a disk is slower than a hand."""
_OUT_OF_REACH = 1e-4
"""Smallest reported distance to a dragged pose [m or rad]: less is not visible."""


@dataclass(frozen=True)
class SessionSetup:
    """Problem, options and presets of a session, which do not change.

    Attributes:
        problem: that it began with.
        options: of the solver.
        presets: that fit the robot, by name.
    """

    problem: MinimumTimeProblem
    options: MinimumTimeOptions
    presets: Mapping[str, ControllerPreset]

    @classmethod
    def of(cls, problem: MinimumTimeProblem, options: MinimumTimeOptions) -> Self:
        return cls(problem, options, fitting_presets(problem))

    def solve(self, state: StudioState) -> Solution | str:
        """Solve the state's problem: the fastest motion, or the reason for a failure."""
        try:
            problem, _ = problem_of(self.problem, carrying(self.problem.robot, state.payload), state, self.presets)
            return solve_minimum_time(problem, replace(self.options, calm=state.calm))
        except ArmdynError as error:
            return str(error)
        except Exception as error:  # the page outlives it
            return f"internal error ({type(error).__name__}: {error}); this is a bug in armdyn"


class Session:
    """State of the page, its problem and its motion. A context: its solver ends with it.

    One thread calls all methods; only `save_problem`, `save_motion` and `save_report` may be called from others.

    Attributes:
        setup: problem, options and presets.
        folder: of the files.
        robot: that carries the state's payload.
        state: the state edited by the user.
        problem: that the state poses; None: it poses none.
        refused: why it poses none; empty: it does.
        touching: the ends at which bodies touch.
        warnings: of the problem, and of the last action.
        solution: the last motion; None: none yet.
        solved: the state that the last result is of.
        failed: reason why the last result is no motion; empty: the result is a motion.
        unsaved: why the state could not be saved; empty: it was.
    """

    def __init__(self, setup: SessionSetup, folder: Path, state: StudioState):
        self.setup, self.folder = setup, folder
        self.state = self._kept = state
        self.robot = carrying(setup.problem.robot, state.payload)
        self.problem: MinimumTimeProblem | None = None
        self.refused, self.failed, self.unsaved = "", "", ""
        self.touching, self.warnings = frozenset[End](), tuple[str, ...]()
        self.solution: Solution | None = None
        self.solved: StudioState | None = None
        self._said = tuple[str, ...]()
        self._due = 0.0
        self._stack = ExitStack()
        self._make_problem()
        self._solver = NewestFirst[StudioState, Solution | str](setup.solve, state)

    def __enter__(self) -> Self:
        self._stack.enter_context(self._solver)
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self._stack.close()
        self._keep(now=True)

    @property
    def computing(self) -> float | None:
        """Time for which the motion of the state has been computed [s]; None if none is being computed."""
        return None if self.current or self.refused else self._solver.seconds

    @property
    def current(self) -> bool:
        """Whether the last result is that of the state."""
        return self.solved == self.state

    def change(self, *warnings: str, **changes: Any) -> None:
        """Change parts of the state.

        Args:
            warnings: of the change itself.
            changes: fields of `StudioState`; positions are clipped to those of the sliders.

        Raises:
            ArmdynError: a value does not fit its field; the state stays unchanged.
        """
        lower, upper = slider_limits(self.setup.problem)
        for end in ("start", "goal"):
            if end in changes:
                changes[end] = tuple(np.clip(changes[end], lower, upper).tolist())
        state = replace(self.state, **changes)
        if state == self.state and warnings == self._said:
            return
        if state.payload != self.state.payload:
            self.robot = carrying(self.setup.problem.robot, state.payload)
        self.state, self._said = state, warnings
        self._make_problem()
        if not (self.refused or self.current):
            self._solver.request(self.state)

    def pose_of(self, end: End) -> pin.SE3:
        """Placement of the arm's tip in the world at the start or the goal."""
        return frame_placement(self.robot, self.robot.tip, np.array(getattr(self.state, end)))

    def drag(self, end: End, to: pin.SE3) -> None:
        """Move the start or the goal so that the arm's tip is at a pose, or as near as it comes.

        Args:
            end: which.
            to: pose in the world; of an arm of fewer than six joints its position counts alone.

        Raises:
            ArmdynError: the pose is not finite.
        """
        robot = self.robot
        goal = GoalPose(robot.tip, to.homogeneous if robot.nv >= 6 else to.translation)
        limits, near = self.setup.problem.limits, np.array(getattr(self.state, end))
        q, error = approached(robot, goal, near, (limits.position_lower, limits.position_upper))
        far, turned = float(np.linalg.norm(error[:3])), float(np.linalg.norm(error[3:]))
        warnings: tuple[str, ...] = ()
        if max(far, turned) > _OUT_OF_REACH:
            rest = f" and {np.rad2deg(turned):.2g}°" if turned > _OUT_OF_REACH else ""
            warnings = (
                f"the {end} is out of reach: the tip stays {1e3 * far:.2g} mm{rest} away from where it was dragged",
            )
        self.change(*warnings, **{end: q})

    def replace_obstacle(self, old: Obstacle, new: Obstacle | None) -> None:
        """Put another obstacle in the place of one; None: remove it."""
        changed = [new if one == old else one for one in self.state.obstacles]
        self.change(obstacles=tuple(one for one in changed if one is not None))

    def tick(self) -> None:
        """Take the solver's newest result, and save the state if it is time."""
        if (found := self._solver.newest()) is not None:
            self._take(*found)
        self._keep()

    def save_problem(self) -> Path:
        """Write the problem of the state.

        Raises:
            ArmdynError, OSError: it cannot be written, or the state poses none.
        """
        if self.problem is None:
            raise ProblemError(f"there is no problem to be saved: {self.refused}")
        return write_whole(self._file(PROBLEM_FILE), self.problem.to_toml(self.folder).encode())

    def save_motion(self) -> Path:
        """Write the motion that is shown.

        Raises:
            ArmdynError, OSError: there is no motion, or the file cannot be written.
        """
        solution = self._shown()
        motion = replace(solution.trajectory, model_hash=solution.problem.robot.model_hash)
        return motion.save(self._file(MOTION_FILE))

    def save_report(self) -> Path:
        """Write the report of the motion that is shown.

        Raises:
            ArmdynError, OSError: there is no motion, or the file cannot be written.
        """
        return self._shown().report(self._file(REPORT_FILE))

    def _file(self, name: str) -> Path:
        self.folder.mkdir(parents=True, exist_ok=True)
        return self.folder / name

    def _shown(self) -> Solution:
        if self.solution is None:
            raise ProblemError("there is no motion yet")
        return self.solution

    def _take(self, state: StudioState, result: Solution | str | None) -> None:
        self.solved = state
        if isinstance(result, Solution) and result.moves:
            self.solution, self.failed = result, ""
        elif isinstance(result, Solution):
            self.failed = result.message
        else:
            self.failed = result or "the computation ended unexpectedly: change something to try again"

    def _make_problem(self) -> None:
        self.problem, self.refused, self.touching, warnings = None, "", frozenset(), tuple[str, ...]()
        try:
            self.problem, warnings = problem_of(self.setup.problem, self.robot, self.state, self.setup.presets)
        except ContactError as error:
            self.refused = str(error)
            self.touching = frozenset(end for end in END_NAMES if np.array_equal(error.q, getattr(self.state, end)))
        except ArmdynError as error:
            self.refused = str(error)
        self.warnings = (*self._said, *warnings)

    def _keep(self, *, now: bool = False) -> None:
        """Save the state if it changed and enough time has passed; a failure is reported, and the session continues."""
        if self.state == self._kept or not (now or time.monotonic() >= self._due):
            return
        self._due = time.monotonic() + _SAVED
        try:
            content = {"format": _FORMAT, **_robot_of(self.setup), "state": self.state.entry()}
            write_whole(self._file(STATE_FILE), (json.dumps(content, indent=1) + "\n").encode())
        except (ArmdynError, OSError) as error:
            self.unsaved = f"the state is not saved: {error}"
        else:
            self._kept, self.unsaved = self.state, ""


def restored(setup: SessionSetup, folder: Path) -> StudioState | None:
    """The state that a session left in a folder; None: none did.

    Raises:
        FileError: the file is not of a session of this robot.
    """
    path = folder / STATE_FILE
    if not path.exists():
        return None
    content = read_json(path, _MAX_BYTES)
    if not isinstance(content, dict) or content.get("format") != _FORMAT:
        raise FileError(path, f"no state of a studio ({_FORMAT})")
    for key, own in _robot_of(setup).items():
        if content.get(key) != own:
            raise FileError(path, f"of another robot: its {key} is {shown(content.get(key))}, not {shown(own)}")
    try:
        state = StudioState.from_entry(content.get("state"), setup.problem.robot.nv)
    except ArmdynError as error:
        raise FileError(path, str(error)) from None
    lower, upper = slider_limits(setup.problem)
    start, goal = (tuple(np.clip(end, lower, upper).tolist()) for end in (state.start, state.goal))
    return replace(state, start=start, goal=goal)


def _robot_of(setup: SessionSetup) -> dict[str, Any]:
    robot = setup.problem.robot
    return {"robot": robot.name, "joints": list(robot.joint_names)}
