"""A robot's kinematic tree as the plain numbers that the bridge takes."""

from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin

_NO_MASS = 1e-100
"""Stands for the zero mass of a body with moments or a payload [kg]: its centre, m c / m, stays finite."""


class Tree(NamedTuple):
    """Moving joints in Pinocchio's order, hashable; arrays of doubles are bytes. See `_bridge/tree.hpp`."""

    parent: tuple[int, ...]
    prismatic: tuple[bool, ...]
    axis: bytes
    placement: bytes
    inertia: bytes
    armature: bytes
    gravity: bytes

    @classmethod
    def of(cls, model: pin.Model, payload_joint: int = -1, without_body: bool = False) -> "Tree":
        """The tree of a model.

        Args:
            model: revolute and prismatic joints.
            payload_joint: index of the joint whose body gets a payload; -1: none.
            without_body: whether that joint's own body is left out.
        """
        parent, prismatic, axis, placement, inertia = [], [], [], [], []
        for i in range(1, model.njoints):
            joint = model.joints[i]
            parent.append(model.parents[i] - 1)
            linear, angular = np.ravel(joint.createData().S).reshape(2, 3)  # its motion subspace: one axis
            prismatic.append(bool(np.any(linear)))
            axis += list(linear + angular)
            placement += [*model.jointPlacements[i].rotation.ravel(), *model.jointPlacements[i].translation]
            body = model.inertias[i].toDynamicParameters()
            if without_body and i - 1 == payload_joint:
                body = np.zeros(10)
            if body[0] == 0 and (np.any(body) or i - 1 == payload_joint):
                body[0] = _NO_MASS
            inertia += list(body)
        arrays = axis, placement, inertia, model.armature, model.gravity.linear
        return cls(tuple(parent), tuple(prismatic), *(np.array(each, dtype=float).tobytes() for each in arrays))

    def arguments(self) -> dict[str, Any]:
        """Keyword arguments of the bridge: lists of integers and flags, arrays of doubles."""
        return {
            name: np.frombuffer(each) if isinstance(each, bytes) else list(each)
            for name, each in self._asdict().items()
        }
