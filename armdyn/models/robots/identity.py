"""Checksum of an arm's equations of motion."""

import hashlib

import numpy as np
import pinocchio as pin

from armdyn.models.values.friction import JointFriction


def model_hash(model: pin.Model, friction: JointFriction) -> str:
    """A SHA-256 of all that an arm's equations of motion depend on, in hexadecimal.

    Joints, placements, inertias with the payload, armature, gravity and friction, each number to 1e-12 of its SI
    unit, so that the last bit of another machine's sine does not matter. Names of links, shapes and limits are
    not in it.

    Args:
        model: the arm.
        friction: in its joints.
    """
    numbers, words = [model.gravity.vector, model.armature], []
    each = (model.names, model.parents, model.joints, model.jointPlacements, model.inertias)
    for name, parent, joint, place, inertia in zip(*(list(one)[1:] for one in each), strict=True):
        words += [f"{name} of {parent}", joint.shortname()]
        numbers += [place.homogeneous.ravel(), inertia.toDynamicParameters()]
        if "Unaligned" in joint.shortname():
            numbers.append(np.ravel(joint.createData().S))
    numbers += friction.per_joint(model.nv)
    numbers.append(np.atleast_1d(friction.width if np.any(friction.coulomb) else 0.0))
    # Plus zero: minus zero becomes zero.
    rounded = (np.round(np.concatenate(numbers), 12) + 0.0).astype("<f8")
    return hashlib.sha256("\n".join(words).encode() + rounded.tobytes()).hexdigest()
