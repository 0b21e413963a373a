"""Loops along references whose payload changes."""

from dataclasses import replace

import numpy as np
import pytest

import armdyn as ad
from armdyn.control.tracking.track import Setup
from armdyn.errors import ProblemError
from problems import pick_and_place

LOOPS = {
    "as it is built": ad.Loop(),
    "observer, two ticks late": ad.Loop(velocity="observer", delay=2, cutoff=150.0),
    "exact, at once": ad.Loop(velocity="exact", delay=0, encoder=0.0),
    "noise": ad.Loop(noise=1e-4, seed=3, antiwindup="back_calculation"),
    "continuous": ad.Loop.ideal(saturate=True),
}
CONTROLLERS = [ad.Lqr(), ad.ComputedTorque(integral=50.0), ad.Pid(ad.PidGains(20.0, 20.0, 0.5), gravity=True)]


def reference(arm, duration=0.4):
    """A ramp, a dwell and a ramp of the same arm."""
    there, back = ad.ramp(arm, [-1, 0.5], [0.2, -0.1], duration), ad.ramp(arm, [0.2, -0.1], [-1, 0.5], duration)
    still = arm.holding_torque([0.2, -0.1])
    return there + ad.Trajectory.at_rest([0.2, -0.1], still, 0.1, arm.joint_names, model_hash=arm.model_hash) + back


@pytest.mark.slow
@pytest.mark.parametrize("controller", CONTROLLERS, ids=lambda one: type(one).__name__)
@pytest.mark.parametrize("name", LOOPS)
def test_a_payload_that_changes_to_itself_changes_nothing(name, controller):
    """Filters, observers, integrals, delayed torques and noise go on over the pieces."""
    loop, arm = LOOPS[name], ad.Robot.from_spec(ad.ArmSpec.paper("rr"), ad.Payload(mass=0.1))
    motion = reference(arm)
    # Another object, and another load: 1e-13 kg make a difference of 1e-12 rad at the most.
    same = arm.with_payload(ad.Payload(mass=0.1 + 1e-13))
    load, other = ad.load_of(arm), ad.load_of(same)
    changing = replace(
        motion, pieces=tuple(replace(p, load=one) for p, one in zip(motion.pieces, (load, other, load), strict=True))
    )
    whole = ad.track(arm, replace(motion, pieces=()), controller, loop=loop, duration=1.1)
    parts = ad.track(arm, changing, controller, loop=loop, duration=1.1)
    assert len(Setup.of(arm, changing, controller, loop, duration=1.1, tolerance=0.005).pieces) == 3
    np.testing.assert_allclose(parts.trajectory.q, whole.trajectory.q, rtol=0, atol=1e-9)
    np.testing.assert_allclose(parts.trajectory.tau, whole.trajectory.tau, rtol=0, atol=1e-6)
    assert [piece.name for piece in parts.trajectory.pieces] == [piece.name for piece in motion.pieces]


@pytest.mark.parametrize("where", [None, "link1"])
def test_a_dropped_payload_is_two_runs(where):
    """Where the loop has no memory, a run whose load changes is one run, and another one from the state then."""
    loop = ad.Loop(velocity="exact", delay=0, encoder=0.0, rate=1000.0)
    bare = ad.Robot.from_spec(ad.ArmSpec.paper("rr"))
    loaded = bare.with_payload(ad.Payload(mass=0.3, com=(0.1, 0, 0), frame=where))
    there = ad.ramp(loaded, [-1, 0.5], [0.2, -0.1], 0.4).as_piece(load=ad.load_of(loaded))
    back = ad.ramp(bare, [0.2, -0.1], [-1, 0.5], 0.4).as_piece(load=ad.load_of(bare), event="release")
    motion, controller = there + back, ad.ComputedTorque()
    run = ad.track(bare, motion, controller, loop=loop, duration=0.8)
    first = ad.track(loaded, replace(motion, pieces=()), controller, loop=loop, duration=0.8)
    k = 400
    np.testing.assert_allclose(run.trajectory.q[: k + 1], first.trajectory.q[: k + 1], rtol=0, atol=1e-12)
    setup = Setup.of(bare, replace(motion, pieces=()), controller, loop, duration=0.8, tolerance=0.005)
    later = replace(setup, start=np.concatenate([run.trajectory.q[k], run.trajectory.v[k]]))
    shifted = replace(later.law, rows=later.law.rows[k:])
    ticks = replace(later.ticks, q=later.ticks.q[k:], v=later.ticks.v[k:], a=later.ticks.a[k:], tau=later.ticks.tau[k:])
    second = replace(later, laws=(shifted,), ticks=ticks, duration=0.8 - k / 1000).run(bare)
    np.testing.assert_allclose(run.trajectory.q[k:], second.trajectory.q, rtol=0, atol=1e-9)
    # The loaded arm along the whole reference goes elsewhere.
    assert np.abs(first.trajectory.q[-1] - run.trajectory.q[-1]).max() > 1e-3
    released = run.trajectory.pieces[1]
    assert released.event == "release" and released.start == pytest.approx(0.4)
    assert (released.model_hash, run.trajectory.pieces[0].model_hash) == (bare.model_hash, loaded.model_hash)


@pytest.mark.slow
@pytest.mark.parametrize("controller", CONTROLLERS[:2], ids=lambda one: type(one).__name__)
def test_a_part_is_picked_and_placed(controller):
    robot, motion = pick_and_place()
    run = ad.track(robot, motion, controller)
    assert run.settled and run.peak_error < 0.02
    blind = ad.track(robot, replace(motion, pieces=()), controller, plant=robot.with_payload(ad.Payload(mass=0.1006)))
    assert run.peak_error < 0.5 * blind.peak_error  # who does not know of the part
    heavier = [robot, *[robot.with_payload(ad.Payload(mass=0.13))] * 2]
    unknown = ad.track(robot, motion, controller, plant=heavier)
    assert run.peak_error < unknown.peak_error < blind.peak_error
    rough = ad.track(robot, motion, controller, plant=robot.with_friction(0.01, 0.02))
    assert rough.peak_error > run.peak_error
    assert [piece.load.mass for piece in rough.trajectory.pieces] == [0.0, 0.1006, 0.1006]


@pytest.mark.slow
def test_plants_that_do_not_fit_the_pieces():
    robot, motion = pick_and_place()
    with pytest.raises(ProblemError, match=r"plant carries 0\.2 kg, and the pieces of the reference have loads"):
        ad.track(robot, motion, plant=robot.with_payload(ad.Payload(mass=0.2)))
    with pytest.raises(ProblemError, match="plant has 2 arms; the reference has 3 pieces: give one arm per piece"):
        ad.track(robot, motion, plant=[robot, robot])
    with pytest.raises(ProblemError, match=r"plant, .*, has 1 joints; .* has 2"):
        ad.track(robot, motion, plant=[robot, robot, ad.Robot.from_spec(ad.ArmSpec.paper("r"))])
    plants = ad.Plants(payload=(1.0, 1.0))
    with pytest.raises(ProblemError, match="pieces of the reference have other loads than rr"):
        ad.monte_carlo(robot, motion, plants=plants, options=ad.MonteCarloOptions(count=1, duration=0.1, workers=1))
    with pytest.raises(ProblemError, match="pieces of the reference have other loads than rr"):
        ad.tune(robot, motion, ad.ControllerFamily.pid(robot, [0.2, -0.1]), plants.corners(robot))
