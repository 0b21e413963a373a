"""Numbers of an arm that are hardly meant: no masses, inertias beyond the links, placeholders, limits below gravity."""

import numpy as np

from armdyn.models.reading.holding import hardest_poses
from armdyn.models.reading.urdf_arm import link_of, massless_links
from armdyn.models.robots.arm import Arm
from armdyn.reprs import joint_unit

_BEYOND = 1.5
"""Radius of gyration over the link's size from which it is named: published arms stay below 1.2."""
_LEAST_SIZE = 0.3
"""Least size of a link, as a part of the arm's reach: short links are wide."""
_MOST = 7
"""Largest number of joints that are named in a sentence, and of sentences on joints."""
_FAST = 10.0
"""Least velocity limit that can be a placeholder [rad/s or m/s]: 1 may be meant."""


def doubts(robot: Arm) -> list[str]:
    """Sentences on numbers of an arm that are hardly meant; empty: none is in doubt."""
    generated = robot.origin is not None and robot.origin.spec is not None
    links, found = ", ".join(massless_links(robot.model)), [] if generated else _placeholders(robot)
    if not robot.has_dynamics:
        unknown = (
            "Replay, compare and check need none, and mintime --kinematic plans without. --repair --density 2700 "
            "estimates inertias from shapes, identify measures them, --armature adds rotors"
        )
        return [f"without mass, so that torques are unknown: {links}. {unknown}", *found]
    left_out = f"without mass, which is right of axes alone, and torques leave them out: {links}"
    return [*([left_out] if links else []), *_large(robot), *found, *_weak(robot)]


def _large(robot: Arm) -> list[str]:
    """Links with more inertia than their mass has within their size."""
    model, found = robot.model, []
    ways = [np.linalg.norm(place.translation) for place in model.jointPlacements]
    least = _LEAST_SIZE * (sum(ways[2:]) + np.linalg.norm(robot.frame(robot.tip).placement.translation))
    for i, inertia in enumerate(model.inertias):
        if i == 0 or inertia.mass == 0:
            continue
        ends = [ways[k] for k in range(model.njoints) if model.parents[k] == i]
        ends += [np.linalg.norm(one.placement.translation) for one in model.frames if one.parentJoint == i]
        size, most = max(least, np.linalg.norm(inertia.lever), *ends), np.linalg.eigvalsh(inertia.inertia)[-1]
        radius = np.sqrt(most / inertia.mass)
        if radius > _BEYOND * size > 0:
            found.append(
                f"{link_of(model, i)}: {inertia.mass:.4g} kg with {most:.4g} kg m² have a radius of gyration of "
                f"{radius:.3g} m, and the link a size of some {size:.2g} m: a lost decimal point, kg mm² or g mm²?"
            )
    return found


def _placeholders(robot: Arm) -> list[str]:
    """Equal limits of all joints that are a power of ten, or 2000, as files have for unknown ones."""
    limits, found = robot.limits, []
    rows = (
        ("torque", "N m", "N", "effort", limits.effort_upper),
        ("velocity", "rad/s", "m/s", "velocity", limits.velocity),
    )
    for what, turns, slides, option, row in rows:
        round_number = f"{row[0]:e}".startswith("1.000000e") or row[0] == 2000
        if row.size > 1 and np.all(row == row[0]) and round_number and (what == "torque" or row[0] >= _FAST):
            unit = joint_unit(robot.slides, turns, slides)
            found.append(
                f"all joints have the {what} limit {row[0]:g} {unit}: a placeholder? --{option}-limit sets others"
            )
    return found


def _weak(robot: Arm) -> list[str]:
    """Joints whose torque limit does not hold the arm everywhere, with a pose."""
    limits, (_, coulomb), found = robot.limits, robot.friction.per_joint(robot.nv), []
    for j, (pose, torque) in enumerate(hardest_poses(robot.model, limits.position_lower, limits.position_upper)):
        limit = limits.effort_upper[j] if torque > 0 else -limits.effort_lower[j]
        unit = "N" if robot.slides[j] else "N m"
        if limits.passive[j] or abs(torque) <= limit + coulomb[j]:
            continue
        at = [
            f"{name} {q:.3g} m" if slides else f"{name} {np.rad2deg(q):.3g}°"
            for name, q, slides in zip(robot.joint_names, pose, robot.slides, strict=True)
            if abs(q) > 1e-3
        ]
        found.append(
            f"{robot.joint_names[j]}: {abs(torque):.3g} {unit} to be held at "
            f"{', '.join(_first(at, '…')) or 'zero'}, its limit is {limit:.4g} {unit}"
        )
    return _first(found, f"and {len(found) - _MOST} more joints whose limits do not hold the arm")


def _first(words: list[str], more: str) -> list[str]:
    """The first of some words; where there are more, a word for these."""
    return words if len(words) <= _MOST else [*words[:_MOST], more]
