"""Arms: as numbers, as URDF, as Pinocchio models."""

from armdyn.models.limits import JointLimits
from armdyn.models.robot import Robot
from armdyn.models.spec import PAPER_ARMS, PAPER_PAYLOADS, ArmSpec, LinkSpec, Payload
from armdyn.models.urdf import urdf_from_spec

__all__ = [
    "PAPER_ARMS",
    "PAPER_PAYLOADS",
    "ArmSpec",
    "JointLimits",
    "LinkSpec",
    "Payload",
    "Robot",
    "urdf_from_spec",
]
