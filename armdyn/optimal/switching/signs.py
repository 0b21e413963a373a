"""Violations of the switching functions' signs, and structures without them.

A torque on the wrong limit gets a bang arc on the other one, or a singular arc where its switching function stays near
zero; a touch of the wrong sign is removed.
"""

from dataclasses import dataclass, replace

import numpy as np

from armdyn.arrays import Array
from armdyn.optimal.arcs.arc import OPPOSITE, VELOCITY, Mode, bang_signs, outward, runs_of
from armdyn.optimal.switching.extremal.change import Change, Segment, SingularControl
from armdyn.optimal.switching.extremal.quadratic_model import LinearRollout
from armdyn.optimal.switching.extremal.rollout import ShootingProblem
from armdyn.optimal.switching.extremal.state_limits import edited
from armdyn.optimal.switching.extremal.structure import SwitchingStructure


@dataclass(frozen=True)
class WrongSign:
    """Stretch with a joint's torque on the wrong limit.

    Attributes:
        value: largest decrease of H on the other limit, relative to time's 1.
        joint: index of the joint.
        mode: the present limit.
        begin: start of the stretch [s].
        end: end of the stretch [s].
        worst: time of the largest decrease [s].
    """

    value: float
    joint: int
    mode: Mode
    begin: float
    end: float
    worst: float


def wrong_signs(extremal: LinearRollout, least: float) -> list[WrongSign]:
    """Stretches on which the switching function has the sign of the other limit, worst first.

    Args:
        extremal: extremal with costates and switching functions.
        least: least decrease of H.
    """
    rollout, width = extremal.rollout, extremal.shooting.problem.limits.actuators.width
    modes, t = np.array(extremal.structure.modes())[rollout.arc], np.repeat(rollout.times, 2)[1:-1]
    found = list[WrongSign]()
    shortest = extremal.shooting.policy.descent.vanished * extremal.structure.duration
    lasting = np.bincount(rollout.arc, weights=rollout.h)[rollout.arc] > shortest  # not between simultaneous changes
    reversals = bang_signs(modes) * width * lasting[:, None]
    falls = (np.stack(np.split(extremal.switching, 2), axis=1) * reversals[:, None]).reshape(t.size, -1)
    for i, fall in enumerate(falls.T):
        for run in runs_of(np.flatnonzero(fall > 0.05 * least)):
            if np.max(fall[run]) > least:
                worst = int(run[np.argmax(fall[run])])
                begin, end = t[max(run[0] - 1, 0)], t[min(run[-1] + 1, t.size - 1)]
                mode = Mode(modes[worst // 2, i])
                found.append(WrongSign(float(fall[worst]), i, mode, float(begin), float(end), float(t[worst])))
    return sorted(found, key=lambda wrong: -wrong.value)


def worst_interval(wrong: list[WrongSign], apart: float) -> tuple[float, float]:
    """Start and end [s] of the worst interval, merged with its joint's intervals within a time [s] of it."""
    own, begin, end = [one for one in wrong if one.joint == wrong[0].joint], wrong[0].begin, wrong[0].end
    for _ in own:
        near = [one for one in own if one.begin <= end + apart and one.end >= begin - apart]
        begin, end = min(begin, *(one.begin for one in near)), max(end, *(one.end for one in near))
    return begin, end


def with_signs(
    extremal: LinearRollout, wrong: list[WrongSign], structure: SwitchingStructure | None = None
) -> SwitchingStructure:
    """Structure with a short bang arc on the other limit where the switching function has the wrong sign.

    Args:
        extremal: extremal with the wrong signs.
        wrong: stretches on the wrong limit, worst first.
        structure: the extremal's structure with other corrections; None: without.
    """
    more: list[tuple[float, Change]] = []
    for one in wrong:
        if one.value < extremal.shooting.policy.switching.worse * wrong[0].value:
            break
        half = (one.end - one.begin) / 8
        middle = min(max(one.worst, one.begin + half), one.end - half)
        for time, mode in ((middle - half, OPPOSITE[one.mode]), (middle + half, one.mode)):
            more.append((time, Change(one.joint, mode)))
    return edited(extremal.rollout, structure or extremal.structure, [], more)


def without_wrong_touches(extremal: LinearRollout) -> SwitchingStructure | None:
    """Structure without touches whose multiplier has the wrong sign; None if all are right.

    A velocity limit that is active for zero time counts as a touch.
    """
    structure, size = extremal.structure, extremal.rollout.start.shape[1]
    changes, short = structure.changes, extremal.shooting.policy.rollout.touch * structure.duration
    held = zip(extremal.rollout.held_states, extremal.multipliers[size:], strict=True)
    outwards = {(k, j < size // 2): outward(changes[k].mode) * multiplier for (k, j, _), multiplier in held}
    idle = []
    for segment in structure.segments():
        begin, end = structure.span(segment)
        of_speed = segment.begin >= 0 and changes[segment.begin].mode in VELOCITY
        if of_speed and end - begin <= short and outwards[segment.begin, False] <= 0:
            idle.append(segment)
    if idle:
        return structure.without(idle)
    gone = {k for (k, on_position), sign in outwards.items() if on_position and changes[k].touch and sign < 0}
    return structure.without_changes(gone) if gone else None


def with_singular(extremal: LinearRollout, wrong: list[WrongSign]) -> SwitchingStructure | None:
    """Structure with a singular arc where the worst joint's switching function stays near zero; None: nowhere.

    Args:
        extremal: extremal whose torques are on limits, or singular.
        wrong: its stretches on the wrong limit, worst first.
    """
    structure, worst, numbers = extremal.structure, wrong[0], extremal.shooting.policy.singular
    begin, end = worst_interval(wrong, numbers.apart * structure.duration)
    own = [k for k, change in enumerate(structure.changes) if change.joint == worst.joint]
    near = 1e-3 * structure.duration
    inside = [k for k in own if begin - near <= structure.times[k] <= end + near]
    if not inside or any(structure.changes[k].touch or structure.changes[k].mode is Mode.FREE for k in inside):
        return None
    begin = max(min(begin, *structure.times[inside]), near)
    end = max(end, *structure.times[inside])
    after = structure.modes()[inside[-1] + 1][worst.joint]
    control = _control(extremal, worst.joint, (begin, end), numbers.few)
    more = [(begin, Change(worst.joint, Mode.FREE, control=control))]
    if end < structure.duration - near:
        more.append((end, Change(worst.joint, after)))
    return edited(extremal.rollout, structure, inside, more)


def with_longer_control(extremal: LinearRollout, least: float) -> SwitchingStructure | None:
    """Structure with further coefficients where singular arcs' switching functions are not zero; None: not needed.

    Args:
        extremal: extremal with free torques.
        least: tolerated decrease of H.
    """
    structure, numbers = extremal.structure, extremal.shooting.policy.singular
    changes = list(structure.changes)
    for k, change in enumerate(structure.changes):
        if change.control and len(change.control.smooth) < numbers.many and idle_fall(extremal, k) > least:
            jumping = jumping_within(structure, change.joint, *structure.span(Segment(k, structure.end_of(k))))
            changes[k] = replace(change, control=change.control.longer(numbers.added, jumping))
    return replace(structure, changes=tuple(changes)) if tuple(changes) != structure.changes else None


def with_bang_arcs(extremal: LinearRollout, least: float) -> SwitchingStructure | None:
    """The structure with bang arcs where free torques stay on their limits; None without such torques.

    Args:
        extremal: extremal with free torques.
        least: least increase of H off a limit.
    """
    structure, now = extremal.structure, extremal.structure
    for k, change in reversed(list(enumerate(structure.changes))):
        if not change.control:
            continue
        if bang_arcs := _on_limits(extremal, k, max(least, idle_fall(extremal, k))):
            now = edited(extremal.rollout, now, [k], _pieces(extremal, k, bang_arcs))
    return None if now is structure else now.without(())


def _on_limits(extremal: LinearRollout, k: int, least: float) -> list[tuple[float, float, Mode]]:
    """Stretches on which a free torque should stay on a limit it has reached: start, end [s], and the limit.

    Args:
        extremal: extremal with that torque.
        k: index of the change that starts it.
        least: tolerated increase of H off the limit.
    """
    joint, numbers = extremal.structure.changes[k].joint, extremal.shooting.policy.singular
    limits = extremal.shooting.problem.limits.actuators
    low, high = limits.lower[joint], limits.upper[joint]
    t, switching, tau = _free_torque(extremal, k)
    out: list[tuple[float, float, Mode]] = []
    for mode, sign, slack in ((Mode.UPPER, -1, high - tau), (Mode.LOWER, 1, tau - low)):
        rise = sign * switching * (high - low)
        runs = runs_of(np.flatnonzero(rise > numbers.rise * least))
        held = [r for r in runs if np.max(rise[r]) > least and np.min(slack[r] / (high - low)) <= numbers.reached]
        out += [(float(t[run[0]]), float(t[run[-1]]), mode) for run in held]
    return sorted(out)


def _pieces(extremal: LinearRollout, k: int, bang_arcs: list[tuple[float, float, Mode]]) -> list[tuple[float, Change]]:
    """A segment of a free torque split into bang arcs and singular controls, with their times."""
    structure, joint = extremal.structure, extremal.structure.changes[k].joint
    numbers = extremal.shooting.policy.singular
    now, stop = structure.span(Segment(k, structure.end_of(k)))
    few = min(len(structure.controls[k].smooth), numbers.many - numbers.added)
    shortest, out = numbers.short * (stop - now), list[tuple[float, Change]]()
    for begin, end, mode in [*bang_arcs, (stop, stop, Mode.FREE)]:
        if begin - now > shortest:
            out.append((now, Change(joint, Mode.FREE, control=_control(extremal, joint, (now, begin), few))))
        else:
            begin = now
        if end > begin:
            out.append((begin, Change(joint, mode)))
        now = max(now, end)
    return out


def _free_torque(extremal: LinearRollout, k: int) -> tuple[Array, Array, Array]:
    """Times [s], switching functions and torques of the free torque that starts at a change.

    At the starts and ends of its steps in turn, each of shape (2 steps,).
    """
    structure, rollout = extremal.structure, extremal.rollout
    own, joint = (rollout.arc > k) & (rollout.arc <= structure.end_of(k)), structure.changes[k].joint
    times = rollout.times[:-1], rollout.times[1:]
    switching = (each[:, joint] for each in np.split(extremal.switching, 2))
    tau = (each[:, joint] for each in rollout.torques.tau)
    t, s, u = (np.column_stack([each[own] for each in pair]).ravel() for pair in (times, switching, tau))
    return t, s, u


def idle_fall(extremal: LinearRollout, k: int) -> float:
    """Largest decrease of H if the free torque that starts at a change moved to a limit."""
    joint, limits = extremal.structure.changes[k].joint, extremal.shooting.problem.limits.actuators
    _, switching, tau = _free_torque(extremal, k)
    falls = np.maximum(switching * (tau - limits.lower[joint]), -switching * (limits.upper[joint] - tau))
    return float(np.max(falls, initial=0.0))


def jumping_within(structure: SwitchingStructure, joint: int, begin: float, end: float) -> frozenset[int]:
    """Other joints with torques that jump between two times [s]."""
    return frozenset(
        change.joint
        for change, time in zip(structure.changes, structure.times, strict=True)
        if begin < time < end and change.joint != joint and not change.touch
    )


def _control(extremal: LinearRollout, joint: int, ends: tuple[float, float], few: int) -> SingularControl:
    """Least-squares polynomial of a joint's torque between two times [s].

    Args:
        extremal: extremal with the torques.
        joint: index of the joint.
        ends: the two times [s].
        few: number of coefficients.
    """
    rollout, numbers = extremal.rollout, extremal.shooting.policy.singular
    t = np.linspace(*ends, numbers.samples + 2)[1:-1]
    own = np.clip(np.searchsorted(rollout.times, t, side="right") - 1, 0, rollout.h.size - 1)
    part = ((t - rollout.times[own]) / np.where(rollout.h[own] > 0, rollout.h[own], 1.0))[:, None]
    first, last = (tau[own] for tau in rollout.torques.tau)
    jumping = jumping_within(extremal.structure, joint, *ends)
    near = control_near(rollout.shooting, joint, first + part * (last - first), jumping, few)
    return near.longer(numbers.added, jumping)


def control_near(
    shooting: ShootingProblem, joint: int, tau: Array, jumping: frozenset[int], few: int
) -> SingularControl:
    """A short singular control fitted to a joint's torque, within its limits.

    Args:
        shooting: the shooting problem.
        joint: index of the joint.
        tau: torques of all joints at evenly spaced places of the segment [N m], shape (samples, nv).
        jumping: other joints that jump within the segment.
        few: number of coefficients of the polynomial.
    """
    limits, unit, numbers = shooting.problem.limits, shooting.torque_unit[joint], shooting.policy.singular
    s = np.linspace(0, 1, len(tau) + 2)[1:-1]
    middle, half = limits.actuators.center, limits.actuators.scale
    signs: Array = np.sign(tau - middle) * (np.abs(tau - middle) > numbers.on_limit * half)
    control = SingularControl((0.0,) * few, tuple((other, (0.0,)) for other in sorted(jumping)))
    terms, _ = control.terms(s, signs)
    fitted = np.linalg.lstsq(terms, (tau[:, joint] - middle[joint]) / unit, rcond=None)[0]
    fitted *= min(1.0, numbers.inside * half[joint] / unit / max(float(np.max(np.abs(terms @ fitted))), 1e-300))
    fitted[0] += middle[joint] / unit
    return control.with_values(fitted)
