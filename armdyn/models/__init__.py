"""Arms: as numbers, as URDF, as Pinocchio models."""

from typing import TYPE_CHECKING

from armdyn.lazy import facade

if TYPE_CHECKING:
    from armdyn.models.friction import JointFriction
    from armdyn.models.limits import JointLimits
    from armdyn.models.obstacles import Box, Capsule, Sphere
    from armdyn.models.reaching import GoalPose
    from armdyn.models.robot import Robot
    from armdyn.models.spec import PAPER_ARMS, PAPER_PAYLOADS, ArmSpec, LinkSpec, Payload
    from armdyn.models.urdf import urdf_from_spec
else:
    __getattr__, __dir__ = facade(
        __name__,
        {
            "friction": "JointFriction",
            "limits": "JointLimits",
            "obstacles": "Box Capsule Sphere",
            "reaching": "GoalPose",
            "robot": "Robot",
            "spec": "PAPER_ARMS PAPER_PAYLOADS ArmSpec LinkSpec Payload",
            "urdf": "urdf_from_spec",
        },
    )

__all__ = [
    "PAPER_ARMS",
    "PAPER_PAYLOADS",
    "ArmSpec",
    "Box",
    "Capsule",
    "GoalPose",
    "JointFriction",
    "JointLimits",
    "LinkSpec",
    "Payload",
    "Robot",
    "Sphere",
    "urdf_from_spec",
]
