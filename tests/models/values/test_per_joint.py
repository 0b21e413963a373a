import numpy as np
import pytest

from armdyn.errors import ProblemError, SpecError
from armdyn.models.values.per_joint import per_joint

JOINTS = ("shoulder", "elbow")


def test_one_number_stands_for_all_and_the_array_is_its_own():
    given = np.array([1.0, 2.0])
    read = per_joint(given, JOINTS, "x")
    read[0] = 5
    assert given[0] == 1
    np.testing.assert_array_equal(per_joint(3, JOINTS, "x"), [3, 3])
    np.testing.assert_array_equal(per_joint([3], JOINTS[:1], "x", scalar=False), [3])
    np.testing.assert_array_equal(per_joint(3, JOINTS[:1], "x", scalar=False), [3])
    np.testing.assert_array_equal(per_joint([1, np.inf], JOINTS, "x", finite=False), [1, np.inf])


def test_without_an_arm_any_number_of_joints_is_right():
    assert per_joint(3.0, None, "x").shape == ()
    assert per_joint([1, 2, 3], None, "x").shape == (3,)


@pytest.mark.parametrize(
    ("value", "options", "message"),
    [
        ([1.0], {}, "x has shape (1,); expected one number or 2, one per joint: shoulder, elbow"),
        ([1.0, 2.0, 3.0], {"scalar": False}, "x has shape (3,); expected 2 numbers, one per joint: shoulder, elbow"),
        (1.0, {"scalar": False}, "x has shape (); expected 2 numbers, one per joint: shoulder, elbow"),
        ([[1.0, 2.0]], {}, "x has shape (1, 2)"),
        ("much", {}, "x is 'much'; expected one number or 2"),
        ([1, None, 2], {}, "expected one number or 2"),
        ([1.0, np.nan], {}, "x of joint 'elbow' is nan (index 1); it must be finite"),
        ([1.0, np.nan], {"finite": False}, "x of joint 'elbow' is nan (index 1); it must be a number, not NaN"),
        ([np.inf, 1.0], {"unit": "rad"}, "x of joint 'shoulder' is inf rad (index 0); it must be finite"),
        (
            -1.0,
            {"sign": "not negative", "unit": "N m"},
            "x of joint 'shoulder' is -1.0 N m (index 0); it must be finite and not neg",
        ),
        ([1.0, 0.0], {"sign": "positive"}, "x of joint 'elbow' is 0.0 (index 1); it must be positive"),
    ],
)
def test_faults_are_named_with_place_and_right_form(value, options, message):
    with pytest.raises(ProblemError) as raised:
        per_joint(value, JOINTS, "x", error=ProblemError, **options)
    assert message in str(raised.value)


@pytest.mark.parametrize("value", [[], [[1.0]], "much", None, np.nan])
def test_nonsense_without_an_arm(value):
    with pytest.raises(SpecError, match=r"^x "):
        per_joint(value, None, "x")
