"""A cycle: steps in order, and the motions from rest to rest between them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, fields, replace
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from armdyn.arguments import each, expect, flag, one_of, several, shown, whole
from armdyn.arrays import Array
from armdyn.cycle.steps import Grasp, Move, Release, Step, Wait
from armdyn.errors import ArmdynError, CycleError, ProblemError, did_you_mean
from armdyn.locks import cached_property
from armdyn.models.robots.poses import pose_given
from armdyn.models.robots.robot import Robot, expect_robot
from armdyn.models.scene.reaching import GoalPose
from armdyn.models.values.spec import Payload
from armdyn.optimal.problem.problem import MinimumTimeProblem
from armdyn.reprs import brief, called

ORDERS = ("given", "free")
_ENDS = ("robot", "q_start", "q_goal", "v_start", "v_goal", "goal_pose", "via")
CONDITIONS = tuple(field.name for field in fields(MinimumTimeProblem) if field.init and field.name not in _ENDS)
"""Names of the conditions of all moves: the keywords of `MinimumTimeProblem` but for its poses."""
RETURN = "return"
"""Name of the move that closes a cycle whose last move ends elsewhere."""


@dataclass(frozen=True, eq=False)
class RestPlace:
    """A rest between two moves.

    Attributes:
        target: joint positions, shape (nv,), or the goal pose that they reach.
        step: number of the step that leads there, from 1 on; 0: the start.
        name: of that step.
        rests: numbers of the steps that are done there at rest.
    """

    target: Array | GoalPose
    step: int
    name: str
    rests: tuple[int, ...] = ()


@dataclass(frozen=True, eq=False)
class Leg:
    """A motion from one stop to the next.

    Attributes:
        move: the step.
        step: its number, from 1 on; one more than the cycle's steps for the way back.
        name: of the step.
        robot: the arm with its payload.
    """

    move: Move
    step: int
    name: str
    robot: Robot


@brief
@dataclass(frozen=True, eq=False, init=False)
class Cycle:
    """An arm's moves, grasps, releases and waits in order.

    The arm rests at the end of every move. Its payload changes only there, so that every move is a motion of its
    own, from rest to rest, with one payload.

    Attributes:
        robot: the arm, with the tool that it always carries.
        start: joint positions at the beginning [rad or m], shape (nv,), or a goal pose.
        steps: in order.
        closed: it ends where it began: a move back is added where the last one ends elsewhere.
        order: "given", or "free": jobs may be done in any order. A job is a stretch of steps from one moment with
            an empty hand to the next: a hole to be drilled, or a part that is picked and placed.
        conditions: of all moves, by the keywords of `MinimumTimeProblem`, such as obstacles, self_collision, preset.
    """

    robot: Robot
    start: Array | GoalPose
    steps: tuple[Step, ...]
    closed: bool
    order: str
    conditions: Mapping[str, Any]

    def __init__(
        self,
        robot: Robot,
        *,
        start: ArrayLike | str | GoalPose,
        steps: Sequence[Step],
        closed: bool = False,
        order: str = "given",
        **conditions: Any,
    ):
        """A cycle of steps.

        Args:
            robot: see above.
            start: see above, or the name of one of `robot.poses`.
            steps: see above.
            closed: see above.
            order: see above.
            conditions: see above.

        Raises:
            CycleError: a step is wrong, or does not follow from those before it: with its number and name.
            ProblemError: another argument is wrong.
        """
        wrong = next((name for name in conditions if name not in CONDITIONS), None)
        if wrong is not None:
            meant = did_you_mean(wrong, CONDITIONS)
            raise ProblemError(f"a cycle has no condition {shown(wrong)}{meant} (known: {', '.join(CONDITIONS)})")
        expect_robot(robot)
        given = several(steps, "steps")
        for i, step in enumerate(given):
            if isinstance(step, type) or not isinstance(step, Move | Grasp | Release | Wait):
                raise ProblemError(f"steps[{i}] is {shown(step)}; it must be a Move, Grasp, Release or Wait")
        if not any(isinstance(step, Move) for step in given):
            raise ProblemError("steps have no Move: a cycle has one Move at least")
        with naming_step(0, "start"):
            place = start if isinstance(start, GoalPose) else pose_given(robot, start, "start")
        values = {
            "robot": robot,
            "start": place,
            "steps": given,
            "closed": flag(closed, "closed"),
            "order": one_of(order, ORDERS, "order"),
            "conditions": MappingProxyType(dict(conditions)),
        }
        for name, value in values.items():
            object.__setattr__(self, name, value)
        self._check_parts()
        _ = self.arms, self.stops

    def _repr_parts(self) -> list[str]:
        """Words of `repr`."""
        return [called(self.robot.name), f"{len(self.steps)} steps", "closed" if self.closed else "open"]

    def name_of(self, step: int) -> str:
        """Name of a step by its number, from 1 on; "start" of 0, "return" of the move after the last step.

        Raises:
            ProblemError: there is no such step.
        """
        if whole(step, "step", least=0, most=len(self.steps) + 1) == 0:
            return "start"
        if step > len(self.steps):
            return RETURN
        one = self.steps[step - 1]
        if one.name:
            return one.name
        if isinstance(one, Grasp):
            return f"grasp {one.part.name}"
        if isinstance(one, Release):
            parts = [self.robot.payload, *(given.part for given in self.steps[:step] if isinstance(given, Grasp))]
            return f"release {parts[-1].name if parts[-1] else ''}".strip()
        return "move" if isinstance(one, Move) else "wait"

    @property
    def dwell(self) -> float:
        """Time at rest in all steps [s]."""
        return float(sum(step.dwell for step in self.steps if not isinstance(step, Move)))

    def rest(self, stop: RestPlace) -> float:
        """Rest at a stop [s].

        Raises:
            ProblemError: the target is no stop of the cycle.
        """
        steps = (self.steps[k - 1] for k in expect(stop, RestPlace, "stop", "one of Cycle.stops").rests)
        return float(sum(step.dwell for step in steps if not isinstance(step, Move)))

    @cached_property
    def moves(self) -> tuple[Leg, ...]:
        """The motions, in the order of the steps, with the way back of a closed cycle."""
        legs = [
            Leg(step, k, self.name_of(k), self.arms[k])
            for k, step in enumerate(self.steps, start=1)
            if isinstance(step, Move)
        ]
        if self.closed and not _same(self._target(legs[-1]), self.start):
            back = len(self.steps) + 1
            legs.append(Leg(Move(self.start, name=RETURN), back, RETURN, self.arms[-1]))
        return tuple(legs)

    @cached_property
    def stops(self) -> tuple[RestPlace, ...]:
        """The stops: the start, then the end of every move."""
        begins = [0, *(leg.step for leg in self.moves)]
        targets = [self.start, *(self._target(leg) for leg in self.moves)]
        ends = [*begins[1:], len(self.steps) + 1]
        return tuple(
            RestPlace(target, step, self.name_of(step), tuple(range(step + 1, end)))
            for step, target, end in zip(begins, targets, ends, strict=True)
        )

    @cached_property
    def arms(self) -> tuple[Robot, ...]:
        """The arm with its payload at the start and after each step, shape (steps + 1,)."""
        arms, bare = [self.robot], None
        for k, step in enumerate(self.steps, start=1):
            if isinstance(step, Grasp):
                with naming_step(k, self.name_of(k)):
                    arms.append(self.robot.with_payload(self._held(k, step.part)))
            elif isinstance(step, Release):
                bare = bare or (self.robot.with_payload(None) if self.robot.payload else self.robot)
                if (held := arms[-1].payload) is not None:
                    with naming_step(k, self.name_of(k)):
                        self._held(k, held, "released")
                arms.append(bare)
            else:
                arms.append(arms[-1])
        return tuple(arms)

    def _held(self, step: int, part: Payload, how: str = "grasped") -> Payload:
        """The part of a grasp or a release, by default in the frame of the goal pose at which it is grasped.

        Raises:
            ProblemError: it is in a frame that is placed otherwise.
        """
        at = next((one.to for one in self.steps[step - 2 :: -1] if step > 1 and isinstance(one, Move)), self.start)
        if not isinstance(at, GoalPose):
            return part
        own = part.frame or (at.frame if how == "grasped" else self.robot.tip)
        if not self.robot.same_place(own, at.frame):
            raise ProblemError(
                f"part {part.name!r} is placed in frame {own!r}, but is {how} where {at.frame!r} is at its goal pose: "
                f"give the goal as one of {own!r}, or place the part in {at.frame!r}, by default the frame of the goal "
                "where it is grasped"
            )
        return part if part.frame or own == self.robot.tip else replace(part, frame=own)

    @property
    def jobs(self) -> tuple[tuple[int, ...], ...]:
        """Numbers of the steps of every job; those of the steps at the start and of the way back are left out."""
        jobs, job, bare = list[tuple[int, ...]](), list[int](), self.robot.payload
        for k, step in enumerate(self.steps, start=1):
            if isinstance(step, Move) and job and self.arms[k - 1].payload is bare:
                jobs.append(tuple(job))
                job = []
            if job or isinstance(step, Move):
                job.append(k)
        last = self.moves[-1].step  # the way back is no job
        back = self.closed and job == [last] and _same(self.stops[-1].target, self.start)
        return tuple(jobs if back else [*jobs, tuple(job)])

    def reordered(self, order: Sequence[int]) -> Cycle:
        """The cycle with its jobs in another given order.

        Args:
            order: numbers of the jobs, from 0 on.

        Raises:
            ProblemError: they are not all of the jobs, once each.
        """
        jobs = self.jobs
        order = each(order, "order", whole, least=0, most=len(jobs) - 1)
        if sorted(order) != list(range(len(jobs))):
            raise ProblemError(f"order is {shown(order)}; it must have each of 0 to {len(jobs) - 1} once")
        first, last = jobs[0][0], jobs[-1][-1]
        steps = [self.steps[k - 1] for job in order for k in jobs[job]]
        steps = [*self.steps[: first - 1], *steps, *self.steps[last:]]
        return Cycle(self.robot, start=self.start, steps=steps, closed=self.closed, **self.conditions)

    def _target(self, leg: Leg) -> Array | GoalPose:
        to = leg.move.to
        with naming_step(leg.step, leg.name):
            return to if isinstance(to, GoalPose) else pose_given(self.robot, to, "to")

    def _check_parts(self) -> None:
        """Refuse a grasp with a full hand, a release with an empty one, and a closed cycle that ends otherwise."""
        part = self.robot.payload
        for k, step in enumerate(self.steps, start=1):
            name = self.name_of(k)
            if isinstance(step, Grasp):
                if part is not None:
                    raise CycleError(k, name, f"the arm still carries {part.name!r}: release it first")
                part = step.part
            if isinstance(step, Release):
                if part is None:
                    raise CycleError(k, name, "the arm carries nothing that it could release: grasp it first")
                if step.part is not None and step.part != part:
                    raise CycleError(k, name, f"the arm carries {part.name!r}, not {step.part.name!r}")
                part = None
        if self.closed and part is not self.robot.payload:
            held = f"still holds {part.name!r}" if part else "no longer holds the part that it held at the start"
            last = len(self.steps)
            raise CycleError(last, self.name_of(last), f"the cycle is closed, but after its last step the arm {held}")


@contextmanager
def naming_step(step: int, name: str) -> Iterator[None]:
    """Context that adds a step's number and name to errors."""
    try:
        yield
    except CycleError:
        raise
    except ArmdynError as error:
        raise CycleError(step, name, str(error)) from error


def _same(one: Array | GoalPose, other: Array | GoalPose) -> bool:
    if isinstance(one, GoalPose) or isinstance(other, GoalPose):
        return one is other or (isinstance(one, GoalPose) and isinstance(other, GoalPose) and one == other)
    return bool(np.array_equal(one, other))
