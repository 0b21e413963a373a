"""From a mesh's solution to its arcs: the structure whose switching functions agree with its modes."""

from armdyn.optimal.arcs.arc import POSITION, Arc, Mode, merged
from armdyn.optimal.arcs.detection import detect
from armdyn.optimal.arcs.phases import Phases, Unresolved
from armdyn.optimal.arcs.posing import Kept, PhaseAim
from armdyn.optimal.arcs.solving import prepare_phases, solve_phases
from armdyn.optimal.arcs.structure import by_sign, with_overlooked, without_idle_touches, without_vanished
from armdyn.optimal.landing.aim import aimed
from armdyn.optimal.program.unknowns import mesh
from armdyn.optimal.proof.certificate import GOAL_TOLERANCE, LIMIT_TOLERANCE, SWITCHING_TOLERANCE, certify
from armdyn.optimal.proof.pontryagin import pontryagin
from armdyn.optimal.refine.land import land
from armdyn.optimal.refine.optimum import Optimum
from armdyn.optimal.solve.attempt import Attempt
from armdyn.optimal.switching.extremal.schedule import Schedule
from armdyn.optimal.switching.reading import schedules_of
from armdyn.optimal.switching.settle import (
    Settled,
    has_switching,
    leaves_idle,
    motion_of,
    prepare_switching,
    setting_of,
    settled,
)
from armdyn.optimal.switching.signs import with_bounces
from armdyn.optimal.task.task import Task
from armdyn.trajectory import Trajectory

Structure = tuple[tuple[tuple[Mode, ...], tuple[tuple[int, Mode], ...]], ...]


def resolve(task: Task, attempt: Attempt) -> Optimum:
    """The arcs of a mesh's solution, or its own motion and why they resist.

    Args:
        task: what is solved.
        attempt: a collocation solution with constant torques between its knots.
    """
    motion, intervals = attempt.trajectory, attempt.intervals
    phases, remark = _structure(task, motion, intervals)
    resolved: Optimum | None = None
    if phases is not None:
        resolved = land(task, phases, remark, intervals)
        if resolved.certificate.ok:
            return resolved
        remark = resolved.certificate.remark
    landed, replay = aimed(task, motion)
    certificate = certify(task.problem, replay, None, remark)
    on_mesh = Optimum(landed, certificate, landed.duration, intervals)
    # Arcs that are not certified are worth having only if their motion is the better one.
    return min((one for one in (resolved, on_mesh) if one is not None), key=_rank)


def _rank(optimum: Optimum) -> tuple[bool, float]:
    """Sorts: those that land within their limits by duration, then the others by what is worst about them."""
    good = optimum.error <= max(GOAL_TOLERANCE, LIMIT_TOLERANCE)
    return not good, optimum.trajectory.duration if good else optimum.error


def prepare_resolving(task: Task) -> None:
    """Build, if it is not there, what `resolve` is most likely to need."""
    prepare_switching(task)
    for finer in (1, 2):
        prepare_phases(task, finer * task.policy.refinement.intervals)


def _structure(task: Task, motion: Trajectory, intervals: int) -> tuple[Phases | None, str]:
    """Phases whose switching functions agree with their modes, or the last ones and why they do not."""
    if task.stop:
        return None, f"{task.stop.word} before the arcs were read"
    problem, numbers = task.problem, task.policy.refinement
    # The torques of a fine mesh need not be on their limits where time hardly tells.
    switch = max(task.policy.arcs.switch, intervals // numbers.blur)
    arcs = merged(detect(problem, motion, mesh(intervals), switch, task.policy.arcs))
    if has_switching(task):
        settled_phases = _by_switching(task, arcs, motion)
        if settled_phases is not None:
            return settled_phases, ""
    guess, seen = motion, set[Structure]()
    last: Phases | None = None
    for _ in range(numbers.rounds):
        if len(arcs) > numbers.most_arcs:
            return last, f"{len(arcs)} arcs: more than {numbers.most_arcs}"
        size = max(numbers.intervals, 3 * len(arcs))
        phases = solve_phases(task, arcs, guess, size, PhaseAim(density=last.density if last else None))
        if isinstance(phases, Unresolved):
            return last, f"the durations of {len(arcs)} arcs did not converge ({phases.message})"
        guess, structure = phases.torques, _named(phases.arcs)
        if structure not in seen and (fewer := without_vanished(phases, task.policy.arcs)):
            seen.add(structure)
            arcs = fewer
            continue
        last = phases
        arcs = with_overlooked(problem, phases, task.policy.arcs) or without_idle_touches(phases)
        if arcs and structure not in seen and not task.stop:
            seen.add(structure)
            continue
        _, switching, worst = pontryagin(problem, phases)
        if worst <= SWITCHING_TOLERANCE:
            return phases, ""
        arcs = by_sign(phases, switching)
        if structure == _named(arcs):  # nothing is to be corrected but the mesh
            return phases, ""
        if structure in seen or task.stop:
            break
        seen.add(structure)
    return last, "the switching structure did not settle"


def _by_switching(task: Task, arcs: list[Arc], motion: Trajectory) -> Phases | None:
    """Phases whose switching functions agree, if the structure can be mended until they do."""
    setting = setting_of(task, motion.duration)
    for reading in schedules_of(setting, arcs, motion):
        schedule: Schedule | None = reading
        while schedule is not None:
            found = settled(setting, schedule, task.stop)
            phases = _phases_of(task, found)
            if phases is not None or task.stop:
                return phases
            schedule = with_bounces(found.extremal) if found.extremal else None  # bounces are no contacts
    return None


def _phases_of(task: Task, found: Settled) -> Phases | None:
    """What a settled structure comes to by collocation, if its switching functions agree."""
    if found.extremal is None or found.wrong > SWITCHING_TOLERANCE or leaves_idle(found.extremal, SWITCHING_TOLERANCE):
        return None
    own, guess = found.arcs, motion_of(found.extremal)
    keep = Kept.of(own, guess) if any(arc.singular for arc in own) else None
    size = max(task.policy.refinement.intervals * (2 if keep else 1), 3 * len(own))
    phases = solve_phases(task, own, guess, size, PhaseAim(near=True, keep=keep))
    if isinstance(phases, Unresolved):
        return None
    # The signs agree by finer steps than this mesh's, but for contacts, whose pulls only the multipliers tell.
    contact = any(mode in POSITION for arc in own for mode in arc.modes)
    return phases if not contact or pontryagin(task.problem, phases)[2] <= SWITCHING_TOLERANCE else None


def _named(arcs: tuple[Arc, ...] | list[Arc]) -> Structure:
    return tuple((arc.modes, arc.touches) for arc in arcs)
