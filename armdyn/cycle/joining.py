"""A solved cycle as one motion, which knows what the arm carries when."""

from collections.abc import Iterator, Sequence
from functools import partial, reduce

from armdyn.arrays import Array
from armdyn.cycle.cycle import Cycle, Leg, RestPlace
from armdyn.cycle.steps import Grasp, Move, Release
from armdyn.errors import TrajectoryError
from armdyn.models.robots.loads import load_of
from armdyn.optimal.answer.solution import Solution
from armdyn.trajectory import Trajectory

_LANDING = 1e-4
"""Largest difference of position [rad or m] and velocity [rad/s or m/s] between a move's end and its stop: a hundred
times the tolerance of a replay's positions, as velocities at the end of a curve are that much coarser."""
_LAST = 1e-6
"""Rest that carries an event at the end of a cycle [s]: far below any controller's tick."""


def joined(cycle: Cycle, legs: Sequence[tuple[Leg, Solution]]) -> Trajectory:
    """The moves of a cycle and its rests as one motion of several pieces.

    A grasp or release without a rest is the event of the piece that follows; at the end a rest of 1 µs.

    Args:
        cycle: its steps.
        legs: its moves, solved, in order; perhaps the first of them only.

    Raises:
        TrajectoryError: there is no move, or a move does not end where the next one begins.
    """
    if not legs:
        raise TrajectoryError("there is no motion: no move of the cycle is solved")
    pieces, event = list[Trajectory](), ""
    at = legs[0][1].problem.poses[0]
    for stop, (leg, solution) in zip(cycle.stops, legs, strict=False):
        *rests, (event, _) = _rests(cycle, stop, at)
        pieces += [piece for _, piece in rests if piece is not None]
        move, arm = solution.trajectory, leg.robot
        pieces.append(move.as_piece(name=leg.name, load=load_of(arm), event=event))
        at = move.q[-1]
    if len(legs) == len(cycle.moves):
        pieces += [piece for _, piece in _rests(cycle, cycle.stops[-1], at, _LAST) if piece is not None]
    return reduce(partial(Trajectory.join, tolerance=_LANDING), pieces)


def _rests(cycle: Cycle, stop: RestPlace, q: Array, least: float = 0.0) -> Iterator[tuple[str, Trajectory | None]]:
    """The rests at a stop as pieces, of so many seconds at least, then the event that has no rest, perhaps empty."""
    event = ""
    for k in stop.rests:
        step, arm = cycle.steps[k - 1], cycle.arms[k]
        if isinstance(step, Move):
            continue
        event = "grasp" if isinstance(step, Grasp) else "release" if isinstance(step, Release) else event or "wait"
        if dwell := max(step.dwell, least):
            still = Trajectory.at_rest(q, arm.holding_torque(q), dwell, arm.joint_names, model_hash=arm.model_hash)
            yield event, still.as_piece(name=cycle.name_of(k), load=load_of(arm), event=event)
            event = ""
    yield event if event != "wait" else "", None
