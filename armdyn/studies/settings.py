"""Settings of cases: their names, kinds and units."""

from collections.abc import Mapping

from armdyn.arguments import Sign, number, shown
from armdyn.errors import ProblemError, did_you_mean
from armdyn.models.robots.poses import position_of
from armdyn.optimal.problem_files import PROBLEM
from armdyn.studies.problems import ARM, POSES, ArmProblems
from armdyn.studies.rows import Value

SIGNS: dict[str, Sign] = {
    "payload": "not negative", "effort_limit": "positive", "effort_scale": "positive", "velocity_limit": "positive",
    "velocity_scale": "positive", "reserve": "not negative", "velocity_reserve": "not negative",
    "damping": "not negative", "friction": "not negative",
}  # fmt: skip
"""Settings of every task that are one number, and its sign. The other settings are the keys of [problem]."""

UNITS = {
    "payload": "kg", "effort_limit": "N m", "velocity_limit": "rad/s", "damping": "N m s/rad", "friction": "N m",
    "acceleration_limit": "rad/s²", "jerk_limit": "rad/s³", "clearance": "m", "q_start": "rad", "q_goal": "rad",
    "kp": "N m/rad or 1/s²", "ki": "N m/(rad s) or 1/s³", "kd": "N m s/rad or 1/s",  # as of the form of "pid"
    "bandwidth": "rad/s", "ramp": "s", "rate": "Hz",
    "delay": "ticks", "position": "rad", "velocity": "s", "integral": "1/s", "cutoff": "Hz", "noise": "rad",
    "plant_payload": "kg", "plant_damping": "N m s/rad", "plant_friction": "N m",
}  # fmt: skip
"""Units of settings."""
CYCLE_UNITS = {
    "mass": "kg", "com": "m", "position": "m", "size": "m", "center": "m", "radius": "m", "clearance": "m",
    "dwell": "s", "wait": "s", "speed": "m/s", "approach": "m", "retreat": "m", "length": "m", "rpy": "rad",
}  # fmt: skip
"""Units of a cycle's settings, by the last word of their names."""
OUTCOMES = {
    "duration_s": "minimum time [s]", "torque_squared": "∫ τᵀτ dt [(N m)² s]", "settled_time_s": "settled time [s]",
    "peak_error": "largest error on the way [rad]", "ms_saved_by_one_per_cent": "saved by 1 % of a limit, at most [ms]",
    "worst_settled_time_s": "settled time of the worst arm [s]", "success_rate": "part of the arms that settle [-]",
}  # fmt: skip
"""Facts on the axes of figures."""


def unit_of(name: str) -> str:
    """Unit of a setting; empty: none."""
    first, *rest = name.split(".")
    if first in ("parts", "steps", "cycle"):
        return next((CYCLE_UNITS[word] for word in reversed(rest) if word in CYCLE_UNITS), "")
    return UNITS.get(first, "")


def label(name: str) -> str:
    """Text of a column on the axes of figures, with its unit."""
    unit = unit_of(name)
    return OUTCOMES.get(name) or (f"{name} [{unit}]" if unit else f"{name} [-]")


def check_setting(name: str, value: object, signs: Mapping[str, Sign], problems: ArmProblems) -> Value:
    """Check name and value of a setting.

    Args:
        name: of the setting; with dots it leads into lists and tables of [problem].
        value: as given.
        signs: settings of the task that are one number.
        problems: of the study.

    Raises:
        ProblemError: there is no such setting, or it cannot have that value.
    """
    first, dot, rest = name.partition(".")
    if name == ARM:
        names = [arm.name for arm in problems.arms]
        if isinstance(value, str) and value in names:
            return value
        raise ProblemError(f"arm is {shown(value)}; the study's arms are {', '.join(names)}")
    if first in POSES:
        return _position(name, rest, value, problems) if dot else _pose(name, value, problems)
    if name in signs:
        found = number(value, name, unit=UNITS.get(name, ""), sign=signs[name])
        if name in ("reserve", "velocity_reserve") and found >= 1:
            raise ProblemError(f"{name} is {found:g}; it is a part of the limits, from 0 to below 1")
        return found
    if first not in PROBLEM:
        known = (ARM, *POSES, *(f"{pose}.JOINT" for pose in POSES), *signs, *PROBLEM)
        meant = did_you_mean(name, known) or f"; settings: {', '.join(dict.fromkeys(known))}"
        raise ProblemError(f"{name} is no setting{meant}")
    for arm in problems.arms if dot else ():
        problems.table({ARM: arm.name, name: value})  # the place is there
    return value


def _pose(name: str, value: object, problems: ArmProblems) -> str:
    """The name of a pose that all arms have."""
    if isinstance(value, str) and all(value in arm.poses for arm in problems.arms):
        return value
    raise ProblemError(f"{name} is {shown(value)}; write names of poses, or {name}.JOINT with positions")


def _position(name: str, joint: str, value: object, problems: ArmProblems) -> float:
    """A position [rad or m] of a joint that all arms have: a number, or a text such as "90deg"."""
    found = 0.0
    for arm in problems.arms:
        robot = problems.robot({ARM: arm.name})
        slides = dict(zip(robot.joint_names, robot.slides.tolist(), strict=True))
        if joint not in slides:
            meant = did_you_mean(joint, slides) or f"; its joints: {', '.join(slides)}"
            raise ProblemError(f"{name}: arm {arm.name} has no joint {joint!r}{meant}")
        found = number(position_of(value, name, slides[joint]), name)
    return found
