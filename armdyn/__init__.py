"""Time-optimal and closed-loop motion of robot arms, from a URDF."""

from armdyn.dynamics import Dynamics
from armdyn.errors import ArmdynError, ArmdynWarning
from armdyn.models import PAPER_PAYLOADS, ArmSpec, JointLimits, LinkSpec, Payload, Robot, urdf_from_spec
from armdyn.trajectory import Sample, Trajectory

__version__ = "0.1.0"

__all__ = [
    "PAPER_PAYLOADS",
    "ArmSpec",
    "ArmdynError",
    "ArmdynWarning",
    "Dynamics",
    "JointLimits",
    "LinkSpec",
    "Payload",
    "Robot",
    "Sample",
    "Trajectory",
    "__version__",
    "urdf_from_spec",
]
