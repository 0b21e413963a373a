"""The robots that go by a name: the arms of example-robot-data, and the package's own benchmarks."""

import os
from dataclasses import dataclass
from pathlib import Path

from armdyn.arguments import text
from armdyn.errors import SpecError, UnknownRobotError, UrdfError
from armdyn.models.robots.descriptions import is_description


@dataclass(frozen=True)
class LibraryArm:
    """An arm inside a robot of the library.

    Attributes:
        robot: the library's name of the robot.
        first: the arm's first joint, or the link that it stands on.
        last: its last joint, or its tip.
    """

    robot: str
    first: str
    last: str


_UR = ("shoulder_pan_joint", "ee_link")
_BRAVO = ("joint1", "joint6")
_SO = ("shoulder_pan", "wrist_roll")
_Z1 = ("joint1", "joint6")

LIBRARY_ARMS: dict[str, LibraryArm] = {
    "anymal_kinova_arm": LibraryArm("anymal_kinova", "j2s6s200_joint_1", "j2s6s200_end_effector"),
    "asr_twodof": LibraryArm("asr_twodof", "J1", "J2"),
    "b1_z1_arm": LibraryArm("b1_z1", *_Z1),
    "baxter_left": LibraryArm("baxter", "left_s0", "left_w2"),
    "baxter_right": LibraryArm("baxter", "right_s0", "right_w2"),
    "bravo7_gripper": LibraryArm("bravo7_gripper", *_BRAVO),
    "bravo7_no_ee": LibraryArm("bravo7_no_ee", *_BRAVO),
    "centauro_left": LibraryArm("centauro", "j_arm1_1", "j_arm1_6"),
    "centauro_right": LibraryArm("centauro", "j_arm2_1", "j_arm2_6"),
    "double_pendulum": LibraryArm("double_pendulum", "joint1", "joint2"),
    "double_pendulum_continuous": LibraryArm("double_pendulum_continuous", "joint1", "joint2"),
    "double_pendulum_simple": LibraryArm("double_pendulum_simple", "joint1", "joint2"),
    "finger_edu": LibraryArm("finger_edu", "finger_base_to_upper_joint", "finger_tip_link"),
    "kinova": LibraryArm("kinova", "j2s6s200_joint_1", "j2s6s200_end_effector"),
    "panda": LibraryArm("panda", "panda_joint1", "panda_hand_tcp"),
    "panda_collision": LibraryArm("panda_collision", "panda_joint1", "panda_joint7"),
    "pr2_left": LibraryArm("pr2", "l_shoulder_pan_joint", "l_gripper_tool_frame"),
    "pr2_right": LibraryArm("pr2", "r_shoulder_pan_joint", "r_gripper_tool_frame"),
    "so100": LibraryArm("so100", *_SO),
    "so101": LibraryArm("so101", *_SO),
    "talos_arm": LibraryArm("talos_arm", "arm_left_2_joint", "gripper_left_base_link"),
    "talos_left": LibraryArm("talos", "arm_left_1_joint", "gripper_left_base_link"),
    "talos_right": LibraryArm("talos", "arm_right_1_joint", "gripper_right_base_link"),
    "tiago_arm": LibraryArm("tiago", "arm_1_joint", "arm_7_joint"),
    "tiago_dual_left": LibraryArm("tiago_dual", "arm_left_1_joint", "arm_left_7_joint"),
    "tiago_dual_right": LibraryArm("tiago_dual", "arm_right_1_joint", "arm_right_7_joint"),
    "tiago_no_hand_arm": LibraryArm("tiago_no_hand", "arm_1_joint", "arm_7_joint"),
    "tiago_pro_left": LibraryArm("tiago_pro", "arm_left_1_joint", "arm_left_7_joint"),
    "tiago_pro_right": LibraryArm("tiago_pro", "arm_right_1_joint", "arm_right_7_joint"),
    "ur10": LibraryArm("ur10", *_UR),
    "ur10_limited": LibraryArm("ur10_limited", *_UR),
    "ur3": LibraryArm("ur3", *_UR),
    "ur3_gripper": LibraryArm("ur3_gripper", *_UR),
    "ur3_limited": LibraryArm("ur3_limited", *_UR),
    "ur5": LibraryArm("ur5", *_UR),
    "ur5_gripper": LibraryArm("ur5_gripper", *_UR),
    "ur5_limited": LibraryArm("ur5_limited", *_UR),
    "xarm7": LibraryArm("xarm7", "joint1", "link_eef"),
    "z1": LibraryArm("z1", *_Z1),
}
"""The library's arms, and those inside its bigger robots; all else of the robot is locked."""

BENCHMARKS: dict[str, tuple[str, ...]] = {
    "acrobot": ("shoulder",),
    "cart_pole": ("pole",),
    "furuta_pendulum": ("pendulum",),
    "pendubot": ("elbow",),
}
"""The benchmarks of underactuated control, and which of their joints have no motor. A URDF's torque limit of zero, by
which many mean none at all, could not say that. Where their numbers come from is said in their files."""

_OWN = Path(__file__).parent / "urdf"

_CORRECTED = {"ur3": "ur3_robot.urdf"}
"""Files that the loaders 5 get wrong: their "ur3" is a UR5."""


def library_names() -> list[str]:
    """All names that `library_arm` knows."""
    from example_robot_data.robots_loader import ROBOTS

    return sorted({*ROBOTS, *LIBRARY_ARMS, *BENCHMARKS})


def other_robots() -> list[str]:
    """The library's robots that are in `LIBRARY_ARMS` neither by name nor by an arm of theirs."""
    from example_robot_data.robots_loader import ROBOTS

    return sorted(set(ROBOTS) - set(LIBRARY_ARMS) - {arm.robot for arm in LIBRARY_ARMS.values()})


def library_arm(name: str) -> tuple[Path, str, LibraryArm | None]:
    """Where an arm's URDF is, the folder in which its `package://` is, and which joints it has.

    Args:
        name: of `LIBRARY_ARMS` or `BENCHMARKS`, or any robot of the library: but for the first no choice of joints
            comes back.

    Raises:
        SpecError: the name is no text.
        UnknownRobotError: the library has neither.
        UrdfError: the robot is not described by a URDF.
    """
    arm = LIBRARY_ARMS.get(text(name, "name of a robot", error=SpecError))
    if name in BENCHMARKS:
        return _OWN / f"{name}.urdf", str(_OWN), None
    if name not in (known := library_names()):
        hint = "" if not is_description(name) else "Robot.from_description reads those of robot_descriptions"
        raise UnknownRobotError(name, known, hint)
    return *library_urdf(name if arm is None else arm.robot), arm


def library_urdf(robot: str) -> tuple[Path, str]:
    """A library robot's URDF file, and the folder in which its `package://` is.

    Raises:
        UnknownRobotError: the library has no such robot.
        UrdfError: the robot is not described by a URDF.
    """
    from example_robot_data.robots_loader import ROBOTS, getModelPath

    if robot not in ROBOTS:
        raise UnknownRobotError(robot, sorted(ROBOTS))
    loader = ROBOTS[robot]
    if not loader.urdf_filename:
        raise UrdfError(robot, "the library describes it by an SDF, not a URDF")
    inside = Path(loader.path, loader.urdf_subpath, _CORRECTED.get(robot, loader.urdf_filename))
    root = Path(loader.model_path or getModelPath(str(inside)))
    return Path(os.path.normpath(root / inside)), os.path.normpath(root.parent.parent)
