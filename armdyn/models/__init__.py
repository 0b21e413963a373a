"""Robot models: specifications, URDF, MJCF, Pinocchio models."""

from typing import TYPE_CHECKING

from armdyn.lazy import facade

if TYPE_CHECKING:
    from armdyn.models.robots.options import RobotOptions
    from armdyn.models.robots.robot import Robot
    from armdyn.models.scene.obstacles import Box, Capsule, Cylinder, Plane, Sphere
    from armdyn.models.scene.reaching import GoalPose
    from armdyn.models.values.friction import JointFriction
    from armdyn.models.values.joint_limits import JointLimits
    from armdyn.models.values.spec import PLANAR_ARMS, ArmSpec, LinkSpec, Payload
    from armdyn.models.values.urdf import urdf_from_spec
else:
    __getattr__, __dir__ = facade(
        __name__,
        {
            "values.friction": "JointFriction",
            "values.joint_limits": "JointLimits",
            "scene.obstacles": "Box Capsule Cylinder Plane Sphere",
            "scene.reaching": "GoalPose",
            "robots.options": "RobotOptions",
            "robots.robot": "Robot",
            "values.spec": "PLANAR_ARMS ArmSpec LinkSpec Payload",
            "values.urdf": "urdf_from_spec",
        },
    )

__all__ = [
    "PLANAR_ARMS",
    "ArmSpec",
    "Box",
    "Capsule",
    "Cylinder",
    "GoalPose",
    "JointFriction",
    "JointLimits",
    "LinkSpec",
    "Payload",
    "Plane",
    "Robot",
    "RobotOptions",
    "Sphere",
    "urdf_from_spec",
]
