"""Tunable parameters, and the controllers that they make."""

import numpy as np
import pytest

import armdyn as ad
from armdyn.errors import ProblemError
from armdyn.studies.tuning.families import by_name, chosen
from problems import POSES, paper_arm

ROBOT, GOAL = paper_arm("rr"), POSES["rr"][1]


def middle(parameters):
    return by_name(parameters, np.array([np.log(one.low * one.high) / 2 for one in parameters]))


def test_gains_of_every_joint():
    family = ad.ControllerFamily.pid(ROBOT, GOAL, shared=False)
    assert [one.name for one in family.parameters] == ["kp1", "kp2", "ki1", "ki2", "kd1", "kd2"]
    values = {one.name: float(i) for i, one in enumerate(family.parameters)}
    assert family.controller(values) == ad.Pid(ad.PidGains((0, 1), (2, 3), (4, 5)), "computed_torque")


def test_gains_of_torques_are_in_proportion_to_inertia():
    inertia = np.diag(ad.Dynamics(ROBOT).crba(np.array(GOAL)))
    each = ad.ControllerFamily.pid(ROBOT, GOAL, form="torque", gravity=True, shared=False)
    one = ad.ControllerFamily.pid(ROBOT, GOAL, form="torque")
    np.testing.assert_allclose([each.parameters[i].low for i in (0, 1)], 100 * inertia)
    shared = one.controller({"kp": 100.0, "ki": 10.0, "kd": 1.0})
    np.testing.assert_allclose([shared.gains.kp, shared.gains.ki, shared.gains.kd], np.outer([100, 10, 1], inertia))
    assert each.controller({p.name: p.low for p in each.parameters}).gravity


@pytest.mark.parametrize("make", ["pid", "computed_torque", "lqr"])
def test_the_middle_of_every_family_moves_the_arm(make):
    family = getattr(ad.ControllerFamily, make)(*((ROBOT, GOAL) if make == "pid" else ()))
    controller = family.controller(middle(family.parameters))
    run = ad.track(ROBOT, ad.ramp(ROBOT, *POSES["rr"], 0.5), controller)
    assert run.status in ("settled", "not_settled")


def test_the_duration_of_a_ramp_is_chosen_too():
    family, ramps = ad.ControllerFamily.lqr(), ad.Ramps(*POSES["rr"], (0.2, 0.8))
    parameters = chosen(family, ramps)
    assert [one.name for one in parameters] == ["position", "velocity", "integral", "ramp"]
    assert ramps.reference(ROBOT, middle(parameters)).duration == pytest.approx(0.4)
    assert chosen(family, ramps.reference(ROBOT, {"ramp": 0.3})) == family.parameters


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: ad.Parameter("kp", 2.0, 1.0), "low of kp is 2, high 1; low must be the less"),
        (lambda: ad.Parameter("kp", 0.0, 1.0), "low of kp is 0.0; it must be positive and finite"),
        (lambda: ad.ControllerFamily("none", (), lambda x: ad.Lqr()), "parameters are none"),
        (lambda: ad.ControllerFamily("two", (ad.Parameter("a", 1, 2),) * 2, lambda x: ad.Lqr()), "of different names"),
        (lambda: ad.Ramps([0], [1], (0.5, 0.2)), "duration goes from 0.5 to 0.2 s"),
        (lambda: ad.ControllerFamily.pid(ROBOT, GOAL, form="linear"), "form is 'linear'"),
        (lambda: ad.ControllerFamily.pid(ROBOT, GOAL, gravity=True), "compensates gravity itself"),
    ],
)
def test_invalid_families_are_refused(make, message):
    with pytest.raises(ProblemError, match=message):
        make()
