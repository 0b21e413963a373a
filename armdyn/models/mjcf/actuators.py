"""Torque limits of joints, from an MJCF's actuators."""

from collections.abc import Mapping
from xml.etree.ElementTree import Element

import numpy as np

from armdyn.models.mjcf.classes import ACTUATORS, Classes, Values
from armdyn.models.reading.urdf_xml import clipped

Range = tuple[float, float]

_UNLIMITED: Range = (-np.inf, np.inf)


def effort_limits(root: Element, classes: Classes, joints: Mapping[str, Values], automatic: bool) -> dict[str, Range]:
    """Lower and upper torque limit of every joint [N m or N]; infinite where no actuator limits it.

    The torque of an actuator is its gear times its force; force is within `forcerange`, and of a motor, which passes
    its control on, within gain times `ctrlrange`. Torques of several actuators of one joint add up, and the joint's own
    `actuatorfrcrange` bounds the sum.

    Args:
        root: of the whole MJCF.
        classes: its default classes.
        joints: name to attributes.
        automatic: see `Compiler`.

    Raises:
        UrdfError: an attribute is no number.
    """
    sums: dict[str, Range] = {}
    for element in root.iterfind("actuator/*"):
        if element.tag not in ACTUATORS:
            continue
        called = f"actuator {clipped(element.get('name', element.tag))!r}"
        values = Values(classes.attributes(element), classes.source, called)
        joint = values.given.get("joint") or values.given.get("jointinparent", "")
        if joint not in joints:
            continue  # a tendon's, a site's, or of a joint that is not written
        gear = (values.numbers("gear", 1, 6) or [1.0])[0]
        ends = [gear * end if gear else 0.0 for end in _force(element.tag, values, automatic)]
        lower, upper = sums.get(joint, (0.0, 0.0))
        sums[joint] = lower + min(ends), upper + max(ends)
    limits = {}
    for name, values in joints.items():
        own = values.bounds("actuatorfrcrange", "actuatorfrclimited", automatic)
        limits[name] = _both(sums.get(name, _UNLIMITED), own or _UNLIMITED)
    return limits


def _force(kind: str, values: Values, automatic: bool) -> Range:
    """Least and largest force of an actuator, before its gear."""
    force = values.bounds("forcerange", "forcelimited", automatic) or _UNLIMITED
    given = values.given
    plain = kind == "motor" or (
        kind == "general"
        and given.get("gaintype", "fixed") == "fixed"
        and given.get("biastype", "none") == "none"
        and given.get("dyntype", "none") in ("none", "filter", "filterexact")
    )
    control = values.bounds("ctrlrange", "ctrllimited", automatic) if plain else None
    if control is None:
        return force
    gain = (values.numbers("gainprm", 1, 10) or [1.0])[0] if kind == "general" else 1.0
    ends = [gain * end for end in control]
    return _both(force, (min(ends), max(ends)))


def _both(one: Range, other: Range) -> Range:
    return max(one[0], other[0]), min(one[1], other[1])
