"""Arms: as numbers, as URDF, as Pinocchio models."""

from armdyn.models.friction import JointFriction
from armdyn.models.limits import JointLimits
from armdyn.models.obstacles import Box, Capsule, Sphere
from armdyn.models.reaching import GoalPose
from armdyn.models.robot import Robot
from armdyn.models.spec import PAPER_ARMS, PAPER_PAYLOADS, ArmSpec, LinkSpec, Payload
from armdyn.models.urdf import urdf_from_spec

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
