import numpy as np
import pytest

from armdyn.models import Robot
from models.mjcf.arms import mjcf, one


def limits(actuators, joint='<joint name="j"/>', default="", compiler=""):
    text = mjcf(one(joint), f"<default>{default}</default><actuator>{actuators}</actuator>", compiler)
    own = Robot.from_mjcf_string(text).limits
    assert np.isinf(own.velocity).all()  # MJCF has none
    return own.effort_lower[0], own.effort_upper[0]


ONE_SIDED = '<motor joint="j" ctrlrange="-1 2"/>'


@pytest.mark.parametrize(
    ("actuators", "expected"),
    [
        ("", (-np.inf, np.inf)),
        ('<motor joint="j"/>', (-np.inf, np.inf)),
        (ONE_SIDED, (-1, 2)),
        ('<motor joint="j" ctrlrange="-1 2" gear="3"/>', (-3, 6)),
        ('<motor joint="j" ctrlrange="-1 2" gear="-3 0 0 0 0 0"/>', (-6, 3)),
        ('<motor joint="j" ctrlrange="-1 2" gear="0"/>', (0, 0)),
        ('<motor joint="j" ctrlrange="-1 2" forcerange="-5 1" gear="2"/>', (-2, 2)),
        ('<motor joint="j" ctrlrange="-1 2" ctrllimited="false" forcerange="-5 5"/>', (-5, 5)),
        ('<motor joint="j" forcerange="-5 5" forcelimited="false"/>', (-np.inf, np.inf)),
        ('<position joint="j" kp="100" ctrlrange="-3 3" forcerange="-87 87"/>', (-87, 87)),
        ('<position joint="j" kp="100" ctrlrange="-3 3"/>', (-np.inf, np.inf)),
        ('<general joint="j" ctrlrange="-1 2" gainprm="4"/>', (-4, 8)),
        ('<general joint="j" ctrlrange="-1 2" gainprm="4" biastype="affine"/>', (-np.inf, np.inf)),
        ('<general joint="j" ctrlrange="-1 2" dyntype="integrator" forcerange="-9 9"/>', (-9, 9)),
        (ONE_SIDED + '<motor joint="j" ctrlrange="-5 5"/>', (-6, 7)),  # they add up
        (ONE_SIDED + '<motor joint="j"/>', (-np.inf, np.inf)),
        ('<motor tendon="t" ctrlrange="-1 1"/>', (-np.inf, np.inf)),
    ],
)
def test_limits_of(actuators, expected):
    assert limits(actuators) == expected


def test_the_joints_own_range_bounds_the_sum():
    joint = '<joint name="j" actuatorfrcrange="-1.5 1.5"/>'
    assert limits("", joint) == (-1.5, 1.5)
    assert limits(ONE_SIDED, joint) == (-1, 1.5)
    assert limits("", joint.replace("/>", ' actuatorfrclimited="false"/>')) == (-np.inf, np.inf)


def test_classes_of_actuators_are_shared():
    """MuJoCo's shortcuts all set the defaults of one `general`."""
    default = '<position forcerange="-4 4"/><default class="strong"><motor gear="10"/></default>'
    assert limits('<motor joint="j"/>', default=default) == (-4, 4)
    assert limits('<general joint="j" class="strong"/>', default=default) == (-40, 40)
    assert limits('<motor joint="j" class="strong" gear="2" forcerange="-1 1"/>', default=default) == (-2, 2)


def test_ranges_that_do_not_go_without_saying():
    assert limits(ONE_SIDED, compiler='autolimits="false"') == (-np.inf, np.inf)
    said = ONE_SIDED.replace("/>", ' ctrllimited="true"/>')
    assert limits(said, compiler='autolimits="false"') == (-1, 2)
    joint = '<joint name="j" range="-90 45"/>'
    for compiler, upper in (("", np.pi / 4), ('autolimits="false"', np.inf)):
        own = Robot.from_mjcf_string(mjcf(one(joint), compiler=compiler)).limits
        assert own.position_upper[0] == pytest.approx(upper, rel=1e-15)
