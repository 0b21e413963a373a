"""Numbers of some joints by name; the others keep theirs."""

import numpy as np
import pytest

import armdyn as ad
from armdyn.errors import SpecError
from armdyn.parsing.numbers import one_or_more


def test_a_limit_by_name_changes_one_joint():
    own = ad.Robot.from_library("ur5")
    joint = own.joint_names[3]
    limits = ad.Robot.from_library("ur5", effort_limit={joint: 12.0}, velocity_limit={joint: 1.0}).limits
    others = np.arange(6) != 3
    assert limits.effort_upper[3] == 12.0 and limits.effort_lower[3] == -12.0 and limits.velocity[3] == 1.0
    np.testing.assert_array_equal(limits.effort_upper[others], own.limits.effort_upper[others])
    np.testing.assert_array_equal(limits.velocity[others], own.limits.velocity[others])


def test_an_unknown_joint_is_refused_with_the_names():
    with pytest.raises(SpecError, match="nix") as caught:
        ad.Robot.from_library("ur5", effort_limit={"nix": 12.0})
    assert ad.Robot.from_library("ur5").joint_names[0] in str(caught.value)


def test_the_command_line_reads_names():
    assert one_or_more("elbow=12, wrist=3", "--effort-limit") == {"elbow": 12.0, "wrist": 3.0}


def test_a_rotor_by_name_leaves_other_rotors():
    own = ad.Robot.from_library("ur5", armature=0.5)
    joint = own.joint_names[3]
    expected = [0.5, 0.5, 0.5, 1.0, 0.5, 0.5]  # 100² · 1e-4 kg m²
    for rotor, gear in (({joint: 1e-4}, 100.0), (1e-4, {joint: 100.0}), ({joint: 1e-4}, {joint: 100.0})):
        np.testing.assert_allclose(
            own.with_armature(None, rotor, gear).model.armature, expected, rtol=1e-12
        )  # rounding
    assert own.with_armature(None, {joint: 0.0}, 100.0).model.armature[3] == 0.0
