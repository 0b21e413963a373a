"""Outcomes read from untrusted JSON: every field's type is checked first."""

from collections.abc import Callable, Mapping
from typing import Any

from armdyn.optimal import Status
from armdyn.paper.outcomes.case import Case
from armdyn.paper.outcomes.outcome import Outcome
from armdyn.trajectory import Trajectory

Check = Callable[[object], bool]


def is_number(value: object) -> bool:
    """Whether a value is a number, which True is not. `files.read_json` returns only finite ones."""
    return isinstance(value, int | float) and not isinstance(value, bool)


def is_number_or_none(value: object) -> bool:
    """Whether a value is a number, or the text of one that is not finite."""
    return value is None or is_number(value)


def is_numbers(value: object) -> bool:
    """Whether a value is a list of numbers."""
    return isinstance(value, list) and all(map(is_number, value))


def is_flag(value: object) -> bool:
    """Whether a value is True or False."""
    return isinstance(value, bool)


def is_text(value: object) -> bool:
    """Whether a value is a string."""
    return isinstance(value, str)


_FIELDS: Mapping[str, Check] = {
    "time": is_number_or_none,
    "success": is_flag,
    "status": is_text,
    "message": is_text,
    "facts": lambda value: isinstance(value, dict),
    "summary": lambda value: isinstance(value, dict),
}
_OPEN_LOOP: Mapping[str, Check] = {
    "certified": is_flag,
    "why_not_certified": is_text,
    **dict.fromkeys(("goal_error", "goal_velocity_error", "limit_violation"), is_number_or_none),
    **dict.fromkeys(("hamiltonian_spread", "switching_violation"), is_number_or_none),
    "objective": is_number,
    "local_optima": is_numbers,
    "solve_time": is_number,
}
_INDIRECT: Mapping[str, Check] = {
    "indirect_time_s": is_number_or_none,
    "indirect_hamiltonian_spread": is_number_or_none,
    "indirect_message": is_text,
}
_DIFFERENCES: Mapping[str, Check] = {
    f"indirect_{name}_difference": is_number for name in ("duration", "q", "v", "tau", "costate_q", "costate_v")
}
_CLOSED_LOOP: Mapping[str, Check] = {
    "settled": is_flag,
    "max_real_eigenvalue": is_number,
    "overshoot": is_numbers,
    "arrival_rule": is_text,
    "goal_error": is_number,
}


def outcome_from(case: Case, content: Mapping[str, Any], motion: Trajectory | None) -> Outcome:
    """An outcome of a case from the fields `time`, `success`, `status`, `message`, `facts` and `summary`.

    Args:
        case: whose.
        content: the fields.
        motion: that belongs to it.

    Raises:
        ValueError: a field is missing, superfluous or of another type, or they contradict each other or the case.
    """
    _check(content, _FIELDS)
    time, facts = content["time"], content["facts"]
    if content["success"] != (time is not None) or (time is not None and (motion is None or time < 0)):
        raise ValueError(f"success is {content['success']}, and the time {time}")
    if content["status"] == Status.INTERRUPTED:
        raise ValueError("an interrupted case is not kept")
    _check(facts, {} if motion is None else _facts(case, facts))
    if motion is not None:
        robot = case.robot()
        if motion.model_hash != robot.model_hash or motion.v.shape[1] != robot.nv:
            raise ValueError("the motion is another arm's")
        if case.kind == "pid" and (facts["arrival_rule"] != case.arrival_rule or len(facts["overshoot"]) != robot.nv):
            raise ValueError("the facts are another loop's")
    return Outcome(case=case, trajectory=motion, **content)


def _facts(case: Case, given: Mapping[str, object]) -> Mapping[str, Check]:
    """The facts that an outcome with a motion has; see `run_case`."""
    if case.kind == "pid":
        return _CLOSED_LOOP
    wanted = dict(_OPEN_LOOP)
    if given.keys() & _INDIRECT.keys():
        wanted |= _INDIRECT
    if given.keys() & _DIFFERENCES.keys():
        wanted |= _DIFFERENCES
    if case.kind == "minimum_time":
        wanted |= {f"switch_times_j{i + 1}": is_numbers for i in range(len(case.q_start))}
    return wanted


def _check(given: Mapping[str, object], wanted: Mapping[str, Check]) -> None:
    if given.keys() != wanted.keys():
        raise ValueError(f"there are {', '.join(given)}, not {', '.join(wanted)}")
    for name, right in wanted.items():
        if not right(given[name]):
            raise ValueError(f"{name} is {given[name]!r}")
