"""Singular arcs: bang arcs are replaced by a singular control where a switching function stays near zero."""

from dataclasses import replace

import numpy as np

from armdyn.arrays import Array
from armdyn.optimal.arcs.arc import Mode, runs_of
from armdyn.optimal.switching.extremal.change import Change, Segment
from armdyn.optimal.switching.extremal.descent import Extremal
from armdyn.optimal.switching.extremal.rollout import ShootingProblem
from armdyn.optimal.switching.extremal.singular_control import SingularControl
from armdyn.optimal.switching.extremal.state_limits import edited
from armdyn.optimal.switching.extremal.structure import SwitchingStructure
from armdyn.optimal.switching.signs import WrongSign, worst_interval


def with_singular(extremal: Extremal, wrong: list[WrongSign]) -> SwitchingStructure | None:
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


def with_longer_control(extremal: Extremal, least: float) -> SwitchingStructure | None:
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


def with_bang_arcs(extremal: Extremal, least: float) -> SwitchingStructure | None:
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


def _on_limits(extremal: Extremal, k: int, least: float) -> list[tuple[float, float, Mode]]:
    """Stretches on which a free torque should stay on a limit it has reached: start, end [s], and the limit.

    Args:
        extremal: extremal with that torque.
        k: index of the change that starts it.
        least: tolerated increase of H off the limit.
    """
    rollout, joint, numbers = extremal.rollout, extremal.structure.changes[k].joint, extremal.shooting.policy.singular
    own = np.flatnonzero((rollout.arc > k) & (rollout.arc <= extremal.structure.end_of(k)))
    limits = extremal.shooting.problem.limits.actuators
    low, high = limits.lower[joint], limits.upper[joint]
    # At the starts and ends of the steps in turn.
    switching = np.column_stack([each[own, joint] for each in np.split(extremal.switching, 2)]).ravel()
    tau = np.column_stack([each[own, joint] for each in rollout.torques.tau]).ravel()
    t = np.column_stack([rollout.times[own], rollout.times[own + 1]]).ravel()
    out: list[tuple[float, float, Mode]] = []
    for mode, sign, slack in ((Mode.UPPER, -1, high - tau), (Mode.LOWER, 1, tau - low)):
        rise = sign * switching * (high - low)
        runs = runs_of(np.flatnonzero(rise > numbers.rise * least))
        held = [r for r in runs if np.max(rise[r]) > least and np.min(slack[r] / (high - low)) <= numbers.reached]
        out += [(float(t[run[0]]), float(t[run[-1]]), mode) for run in held]
    return sorted(out)


def _pieces(extremal: Extremal, k: int, bang_arcs: list[tuple[float, float, Mode]]) -> list[tuple[float, Change]]:
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


def idle_fall(extremal: Extremal, k: int) -> float:
    """Largest decrease of H if the free torque that starts at a change moved to a limit."""
    structure, rollout = extremal.structure, extremal.rollout
    joint, limits = structure.changes[k].joint, rollout.shooting.problem.limits
    own = (rollout.arc > k) & (rollout.arc <= structure.end_of(k))
    falls = [0.0]
    for switching, tau in zip(np.split(extremal.switching, 2), rollout.torques.tau, strict=True):
        s, u = switching[own, joint], tau[own, joint]
        falls += [
            *(np.maximum(s, 0) * (u - limits.actuators.lower[joint])),
            *(np.maximum(-s, 0) * (limits.actuators.upper[joint] - u)),
        ]
    return float(max(falls))


def jumping_within(structure: SwitchingStructure, joint: int, begin: float, end: float) -> frozenset[int]:
    """Other joints with torques that jump between two times [s]."""
    return frozenset(
        change.joint
        for change, time in zip(structure.changes, structure.times, strict=True)
        if begin < time < end and change.joint != joint and not change.touch
    )


def _control(extremal: Extremal, joint: int, ends: tuple[float, float], few: int) -> SingularControl:
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
