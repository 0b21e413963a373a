"""The search: against a grid, the same with any number of threads, stopped, and the numbers that it is for."""

import signal
import time

import numpy as np
import pytest

import armdyn as ad
from armdyn.control.tracking.track import Setup
from armdyn.errors import ProblemError
from armdyn.paper import GAINS
from armdyn.studies.tuning.index import performance_of
from problems import POSES, paper_arm

ROBOT = paper_arm("r")
FRICTION = {"coulomb": (0.0, 0.06), "damping": (0.0, 0.003)}
ARMS = ad.Plants(**FRICTION).corners(ROBOT)
RAMP = ad.ramp(ROBOT, *POSES["r"], 0.3)
STIFFNESS = ad.ControllerFamily(
    "one number", (ad.Parameter("bandwidth", 5.0, 200.0),), lambda x: ad.ComputedTorque(x["bandwidth"])
)
SHORT = {"duration": 0.8, "generations": 6, "members": 8}


@pytest.mark.slow
def test_the_search_is_as_good_as_a_grid():
    found = ad.tune(ROBOT, RAMP, STIFFNESS, ARMS, options=ad.TuneOptions(**SHORT))
    grid = []
    for bandwidth in np.geomspace(5.0, 200.0, 60):
        setup = Setup.of(ROBOT, RAMP, ad.ComputedTorque(bandwidth), ad.Loop(), duration=0.8, tolerance=0.005)
        grid.append(performance_of(setup, ARMS, "settled").cost(0.05))
    assert found.training.cost(0.05) <= min(grid) * 1.01  # the grid's cells are 6 % wide
    assert found.training.cost(0.05) < np.median(grid)
    assert found.controller == ad.ComputedTorque(found.values["bandwidth"])
    assert found.evaluations >= 8 * 2


@pytest.mark.slow
def test_a_ramp_within_the_velocity_limits_is_preferred():
    """To shorter ones, with which the arm settles sooner."""
    slow = ROBOT.with_limits(None, 15 / 8 * np.abs(np.subtract(*POSES["r"])).max() / 0.4)
    ramps, quick = ad.Ramps(*POSES["r"], (0.1, 0.8)), ad.TuneOptions(duration=1.2, generations=2, members=8)
    found = ad.tune(slow, ramps, STIFFNESS, [slow], options=quick)
    assert found.training.beyond_limits == 0 and found.training.settled == 1
    assert found.reference.duration > 0.4 / 1.01


@pytest.mark.slow
def test_the_same_with_any_number_of_threads():
    family, ramps = ad.ControllerFamily.pid(ROBOT, POSES["r"][1]), ad.Ramps(*POSES["r"], (0.15, 0.5))
    answers = [
        ad.tune(ROBOT, ramps, family, ARMS[:2], options=ad.TuneOptions(workers=workers, generations=2, members=4))
        for workers in (1, 3)
    ]
    assert answers[0].values == answers[1].values
    assert answers[0].history == answers[1].history
    assert answers[0].reference.duration == pytest.approx(answers[0].values["ramp"])
    assert list(answers[0].history) == sorted(answers[0].history, reverse=True)


def test_held_out_arms_are_run_along_the_answer_alone():
    others = ad.Plants(seed=5, **FRICTION).arms(ROBOT, 7)
    found = ad.tune(
        ROBOT, RAMP, STIFFNESS, ARMS[:1], others, options=ad.TuneOptions(generations=1, members=4, index="itae")
    )
    setup = Setup.of(ROBOT, RAMP, found.controller, ad.Loop(), duration=1.5, tolerance=0.005)
    assert found.held_out == performance_of(setup, others, "itae")
    assert found.training == performance_of(setup, ARMS[:1], "itae")
    assert found.training.count == 1
    assert "held out: " in found.message


def test_ctrl_c_gives_the_best_so_far():
    def press(text):
        signal.raise_signal(signal.SIGINT)

    options = ad.TuneOptions(generations=500, members=4)
    found = ad.tune(ROBOT, RAMP, STIFFNESS, ARMS[:1], options=options, progress=press)
    assert found.status == "interrupted"
    assert found.message.startswith("interrupted: 1 of 1 settle")
    assert found.evaluations < 500


def test_a_time_limit_gives_the_best_so_far():
    options = ad.TuneOptions(generations=5000, members=4, time_limit=0.5)
    found = ad.tune(ROBOT, RAMP, STIFFNESS, ARMS[:1], options=options, progress=lambda text: time.sleep(0.5))
    assert found.status == "time_limit"
    assert found.message.startswith("time limit reached: 1 of 1 settle")
    assert len(found.history) == 1


@pytest.mark.slow
def test_an_answer_keeps_to_the_overshoot_where_another_would_settle_sooner():
    family = ad.ControllerFamily("loose", (ad.Parameter("kd", 1.0, 100.0),), lambda x: ad.Pid(
        ad.PidGains(2000.0, 0.0, x["kd"]), form="computed_torque", feedforward=False
    ))  # fmt: skip
    sudden = ad.ramp(ROBOT, [0.0], [0.1], 0.02)
    strict, free = (
        ad.tune(ROBOT, sudden, family, ARMS[1:2], options=ad.TuneOptions(overshoot=most, **SHORT))
        for most in (0.001, 10.0)
    )
    # A joint of 45 rad/s settles soonest with a few per cent of overshoot: 4 % at a damping of 0.7.
    assert strict.training.overshoot <= 0.001 < 0.01 < free.training.overshoot
    assert free.training.settled_time < strict.training.settled_time


def test_a_search_without_arms_or_without_a_law_is_refused():
    with pytest.raises(ProblemError, match="plants are none"):
        ad.tune(ROBOT, RAMP, STIFFNESS, ())
    with pytest.raises(ProblemError, match=r"plants\[1\] is 3"):
        ad.tune(ROBOT, RAMP, STIFFNESS, (ROBOT, 3))
    two = paper_arm("rr")
    with pytest.raises(ProblemError, match="no controller was run: the reference has 1 joints; rr has 2"):
        ad.tune(two, RAMP, STIFFNESS, (two,), options=ad.TuneOptions(generations=1, members=2))


@pytest.mark.slow
@pytest.mark.parametrize(("arm", "longest", "most", "generations"), [("rr", 0.5, 0.45, 2), ("rrr", 0.6, 0.65, 4)])
def test_a_sampled_pid_controller_is_tuned_over_payloads_and_friction(arm, longest, most, generations):
    robot, ends = paper_arm(arm), POSES[arm]
    arms, others = ad.Plants(**FRICTION).corners(robot), ad.Plants(**FRICTION).arms(robot, 50)
    family = ad.ControllerFamily.pid(robot, ends[1])
    # Half a per cent less than is required of the held-out arms, on which it is not chosen.
    options = ad.TuneOptions(generations=generations, duration=1.2, overshoot=0.045)
    found = ad.tune(robot, ad.Ramps(*ends, (0.2, longest)), family, arms, others, options=options)
    for each in (found.training, found.held_out):
        assert each.settled_time <= most
        assert each.overshoot <= 0.05
    paper = ad.track(robot, ad.set_point(robot, ends[1]), ad.Pid(GAINS, "torque", False), q_start=ends[0])
    assert not paper.settled
    assert "unstable for its sampling" in paper.message
