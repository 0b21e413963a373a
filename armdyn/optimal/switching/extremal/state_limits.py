"""Position and velocity limits that a rollout exceeds; touches of the former and arcs on the latter."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np

from armdyn.arrays import Array
from armdyn.optimal.arcs.arc import OPPOSITE, TOWARDS, VELOCITY, Mode, runs_of
from armdyn.optimal.switching.extremal.change import Change
from armdyn.optimal.switching.extremal.rollout import Rollout
from armdyn.optimal.switching.extremal.structure import SwitchingStructure


def excess(rollout: Rollout) -> float:
    """Largest excess at the steps' ends: of position limits [rad or m], of velocity limits as a part of them."""
    n = rollout.shooting.problem.robot.nv
    over = np.max(np.abs(rollout.end[:, n:]) / rollout.shooting.problem.limits.velocity) - 1
    return max(beyond_position(rollout), float(over))


def within_limits(rollout: Rollout) -> bool:
    """Whether the largest excess of state limits is negligible."""
    return excess(rollout) <= rollout.shooting.policy.rollout.beyond


def beyond_position(rollout: Rollout) -> float:
    """Largest excess of position limits at the steps' ends [rad or m]."""
    n, limits = rollout.shooting.problem.robot.nv, rollout.shooting.problem.limits
    q = rollout.end[:, :n]
    return float(max(np.max(q - limits.position_upper), np.max(limits.position_lower - q)))


def with_limits(rollout: Rollout) -> SwitchingStructure | None:
    """The structure with touches of the position limits that a rollout exceeds; None: no limit is exceeded.

    If the limit is exceeded next to a touch of the same limit, the joint does not leave it: the touch becomes a
    contact. An arc of outward torque just before or after a contact is removed. A joint that exceeds its velocity limit
    is held on it for that time.
    """
    structure, removed, more = rollout.structure, set[int](), list[tuple[float, Change, Array]]()
    for over in _limit_excesses(rollout):
        if over.mode in VELOCITY:
            removed.update(over.changes(structure))
            changes = [(over.begin, Change(over.joint, over.mode)), (over.end, over.after(structure))]
        elif (pressed := over.pressed_beside_contact(structure)) is not None:
            removed.add(pressed)
            continue
        else:
            near = [k for k in over.touched(structure) if k not in removed]
            times = [over.worst, *(float(structure.times[k]) for k in near)]
            begin, end, i = min(times), max(times), over.joint
            removed.update(near)
            changes = [(begin, Change(i, over.mode, touch=end == begin))]
            if end > begin:
                after = structure.modes()[int(np.searchsorted(structure.times, end, side="right"))][i]
                changes.append((end, Change(i, after)))
        more += [(time, change, _state_on(rollout, time, over)) for time, change in changes]
    return structure.without_changes(removed).with_changes(more).without(()) if more or removed else None


@dataclass(frozen=True)
class _LimitExcess:
    """Stretch of a rollout beyond a position or velocity limit.

    Attributes:
        joint: index of the joint.
        mode: the limit.
        bound: value of the limit [rad or m, or rad/s or m/s].
        begin: end of the step before the stretch [s].
        end: start of the step after the stretch [s].
        worst: time of the largest excess [s].
        short: length up to which an arc may be removed [s].
    """

    joint: int
    mode: Mode
    bound: float
    begin: float
    end: float
    worst: float
    short: float

    def touched(self, structure: SwitchingStructure) -> list[int]:
        """Indices of the touches of the same limit in that time."""
        touch = self.joint, self.mode, True
        near = [(k, structure.changes[k]) for k in structure.within(self.begin, self.end)]
        return [k for k, change in near if (change.joint, change.mode, change.touch) == touch]

    def pressed_beside_contact(self, structure: SwitchingStructure) -> int | None:
        """Index of the change to a short outward torque between a contact and inward torque; None: no such arc."""
        own = [k for k, change in enumerate(structure.changes) if change.is_of(self.joint)]
        last = int(np.searchsorted(structure.times[own], self.worst, side="right")) - 1
        if not 0 <= last < len(own) - 1:
            return None
        begin, end = own[last], own[last + 1]
        modes = structure.modes()[begin][self.joint], structure.changes[end].mode
        pressed = structure.changes[begin].mode is TOWARDS[self.mode] and self.mode in modes
        inward = OPPOSITE[TOWARDS[self.mode]] in modes
        short = structure.times[end] - structure.times[begin] <= self.short
        return begin if pressed and inward and short else None

    def changes(self, structure: SwitchingStructure) -> list[int]:
        """Indices of the changes of the joint's mode in that time."""
        return [k for k in structure.within(self.begin, self.end) if structure.changes[k].is_of(self.joint)]

    def after(self, structure: SwitchingStructure) -> Change:
        """The change to the joint's mode at the end of that time."""
        before = (structure.changes[k] for k in structure.within(-np.inf, self.end))
        own = [change for change in before if change.is_of(self.joint)]
        return own[-1] if own else Change(self.joint, structure.first[self.joint])


def _limit_excesses(rollout: Rollout) -> Iterator[_LimitExcess]:
    """Stretches of a rollout beyond position and velocity limits, joint by joint."""
    limits, t, n = rollout.shooting.problem.limits, rollout.times, len(rollout.structure.first)
    short = rollout.shooting.policy.descent.short * rollout.structure.duration
    for i in range(n):
        q, upper, lower = rollout.end[:, i], float(limits.position_upper[i]), float(limits.position_lower[i])
        v, fastest = rollout.end[:, n + i], float(limits.velocity[i])
        sides = (
            (Mode.POSITION_UPPER, upper, q - upper),
            (Mode.POSITION_LOWER, lower, lower - q),
            (Mode.VELOCITY_UPPER, fastest, v / fastest - 1),
            (Mode.VELOCITY_LOWER, -fastest, -v / fastest - 1),
        )
        for mode, bound, beyond in sides:
            for run in runs_of(np.flatnonzero(beyond > rollout.shooting.policy.rollout.beyond)):
                worst = float(t[1 + run[np.argmax(beyond[run])]])
                begin, end = float(t[run[0]]), float(t[min(run[-1] + 2, t.size - 1)])
                yield _LimitExcess(i, mode, bound, begin, end, worst, short)


def _state_on(rollout: Rollout, time: float, over: _LimitExcess) -> Array:
    """The state at a time [s], with the joint on the exceeded limit; at rest on a position limit."""
    state, n = state_at(rollout, time), len(rollout.structure.first)
    if over.mode in VELOCITY:
        state[n + over.joint] = over.bound
    else:
        state[over.joint], state[n + over.joint] = over.bound, 0.0
    return state


def edited(
    rollout: Rollout, structure: SwitchingStructure, removed: Iterable[int], more: Iterable[tuple[float, Change]]
) -> SwitchingStructure:
    """Remove and insert changes of a switching structure.

    Args:
        rollout: rollout with the states at inserted changes.
        structure: the rollout's structure, possibly edited already.
        removed: changes to remove.
        more: changes to insert, with their times.
    """
    return structure.without_changes(removed).with_changes((time, one, state_at(rollout, time)) for time, one in more)


def state_at(rollout: Rollout, time: float) -> Array:
    """(q, v) at a time [s]; between steps approximate: cubic Hermite, and linear."""
    k = int(np.clip(np.searchsorted(rollout.times, time, side="right") - 1, 0, rollout.h.size - 1))
    h, n = rollout.h[k], rollout.start.shape[1] // 2
    s = float(np.clip((time - rollout.times[k]) / h, 0, 1)) if h > 0 else 0.0
    a, b = rollout.start[k], rollout.end[k]
    q = a[:n] + s**2 * (3 - 2 * s) * (b[:n] - a[:n]) + h * s * (1 - s) * ((1 - s) * a[n:] - s * b[n:])
    return np.concatenate([q, (1 - s) * a[n:] + s * b[n:]])
