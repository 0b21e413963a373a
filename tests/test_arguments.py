"""Checks return the value itself or raise an `ArmdynError` that names the argument."""

import inspect
from collections import deque
from dataclasses import dataclass, replace
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import armdyn as ad
from armdyn import arguments
from armdyn.errors import ArmdynError, ProblemError, SpecError, UrdfError
from armdyn.paper import IndirectOptions, compare_with_direct, solve_indirect
from oracles import two_links
from problems import CART
from public_calls import NONSENSE, Hostile, Unending, defaults, values

RR = ad.Robot.from_spec(ad.ArmSpec.paper("rr"))
START, GOAL = [0.0, 0.0], [1.0, -0.5]
PROBLEM = ad.MinimumTimeProblem(RR, q_start=START, q_goal=GOAL)
MOTION = ad.Trajectory([0.0, 1.0], np.zeros((2, 2)), np.zeros((2, 2)), np.zeros((2, 2)))

NUMBERS = (
    0, -1, True, 2**70, 10**5000, 0.0, -0.0, 5e-324, 1e-300, 1e300, -1e300, np.nan, np.inf, -np.inf, Fraction(1, 3),
    np.float32(1), np.int8(3), np.array(1.0), np.array([]), [], [[]], [1.0, 2.0], [1.0, np.nan], [1e300, -1e300],
    [1.0, 2.0, 3.0], np.zeros((2, 2)), np.eye(4), 1e300 * np.eye(4), np.zeros((1, 2, 3)),
)  # fmt: skip
ANYTHING = st.sampled_from(NONSENSE + NUMBERS) | st.floats() | st.lists(st.floats(), max_size=4) | st.text(max_size=9)

LINK = {"length": 0.25, "com": 0.1, "mass": 0.2, "inertia": 1e-3}
VALUES = values() | {IndirectOptions: defaults(IndirectOptions)}


@pytest.mark.slow
@pytest.mark.parametrize("made", VALUES, ids=lambda made: made.__name__)
@settings(max_examples=50)  # test_public_calls tries every wrong value alone
@given(data=st.data())
def test_values_are_made_of_anything_or_refused(made, data):
    right = VALUES[made]
    wrong = data.draw(st.lists(st.sampled_from(sorted(right)), min_size=1, max_size=2, unique=True))
    attempt(made, right | {name: data.draw(ANYTHING) for name in wrong})


@pytest.mark.parametrize("made", [ad.Arc, ad.Certificate, ad.Run, ad.Sample, ad.Sensitivities, ad.Solution])
def test_answers_hold_their_arguments(made):
    for value in NONSENSE:
        attempt(made, dict.fromkeys(inspect.signature(made).parameters, value))


def attempt(made, values):
    """No other error than armdyn's own."""
    try:
        with np.errstate(all="ignore"), pytest.MonkeyPatch.context() as patch:
            patch.setattr("warnings.warn", lambda *_, **__: None)
            made(**values)
    except ArmdynError as error:
        assert str(error) and len(str(error)) < 2000


@pytest.mark.parametrize("value", ["euphoric", None, 1, b"solved"])
def test_a_status_is_one_of_them(value):
    assert ad.Status("solved") is ad.Status.SOLVED
    with pytest.raises(ProblemError, match="it is one of solved, replay_missed"):
        ad.Status(value)


SIMULATION = {"q_start": START, "q_goal": GOAL, "duration": 1e-3, "samples": 2}
WRONG = [
    (lambda: ad.solve_minimum_time(RR, START, GOAL), "problem is <Robot.* must be a MinimumTimeProblem: pose it"),
    (lambda: ad.solve_minimum_time("rr"), "problem is 'rr'"),
    (lambda: ad.solve_minimum_time(PROBLEM, {}), "options is {}; it must be a MinimumTimeOptions"),
    (lambda: ad.solve_minimum_time(PROBLEM, None, "loud"), "progress is 'loud'; it must be a function"),
    (lambda: solve_indirect(RR), "problem is <Robot"),
    (lambda: solve_indirect(PROBLEM, options=ad.MinimumTimeOptions()), "options is .* must be an IndirectOptions"),
    (
        lambda: solve_indirect(PROBLEM, MOTION),
        "seed is <Trajectory.* must be a Solution: the result of solve_minimum_time",
    ),
    (lambda: compare_with_direct(PROBLEM), "indirect is <MinimumTimeProblem"),
    (lambda: ad.time_optimality("rr", MOTION), "robot is 'rr'; it must be a Robot: use Robot.from_library"),
    (lambda: ad.time_optimality(RR, START), "trajectory is .0.0, 0.0."),
    (lambda: ad.MinimumTimeProblem("rr", q_start=START, q_goal=GOAL), "robot is 'rr'; it must be a Robot"),
    (
        lambda: ad.MinimumTimeProblem(RR, q_start=None, q_goal=GOAL),
        "q_start is None; expected 2 numbers, one per joint",
    ),
    (lambda: ad.MinimumTimeProblem(RR, q_start=["0", "0"], q_goal=GOAL), "q_start is .'0', '0'.; expected 2"),
    (lambda: ad.MinimumTimeProblem(RR, q_start=[1j, 0], q_goal=GOAL), "q_start is "),
    (lambda: ad.MinimumTimeProblem(RR, q_start=[[0], [1, 2]], q_goal=GOAL), "q_start is "),
    (lambda: ad.MinimumTimeProblem(RR, q_start=START, q_goal=[True, False]), "q_goal is "),
    (lambda: ad.MinimumTimeProblem(RR, q_start=START, goal_pose="tip"), "goal_pose is 'tip'; it must be a GoalPose"),
    (lambda: ad.MinimumTimeProblem(RR, q_start=START, q_goal=GOAL, wrap="no"), "wrap is 'no'; it must be True or F"),
    (
        lambda: ad.MinimumTimeProblem(RR, q_start=START, q_goal=GOAL, path_constraints=[ad.Sphere]),
        r"path_constraints\[0\] = ",
    ),
    (
        lambda: ad.MinimumTimeProblem(RR, q_start=START, q_goal=GOAL, path_constraints=1),
        "path_constraints is 1; it must be a list",
    ),
    (lambda: ad.MinimumTimeOptions(seed=-1), "seed is -1; it must be at least 0"),
    (lambda: ad.MinimumTimeOptions(starts=True), "starts is True; it must be a whole number"),
    (lambda: ad.MinimumTimeOptions(starts=2.5), "starts is 2.5; it must be a whole number"),
    (lambda: ad.MinimumTimeOptions(time_limit="300"), "time_limit is '300'; it must be a number"),
    (lambda: ad.MinimumTimeOptions(bound=1), "bound is 1; it must be True or False"),
    (lambda: IndirectOptions(method="euler"), "method is 'euler'; it is one of 'lobatto', 'trapezoidal'"),
    (lambda: IndirectOptions(seed=-1), "seed is -1"),
    (lambda: ad.PidGains("30", 50, 10), "kp is '30'; expected one number, or one per joint"),
    (lambda: ad.simulate_pid("rr", **SIMULATION), "robot is 'rr'"),
    (lambda: ad.simulate_pid(RR, **SIMULATION, gains=(30, 50, 10)), "gains is .30, 50, 10.; it must be a PidGains"),
    (lambda: ad.simulate_pid(RR, **SIMULATION, form=None), "form is None; it is one of"),
    (lambda: ad.simulate_pid(RR, **SIMULATION, saturate=1), "saturate is 1; it must be True or False"),
    (lambda: ad.simulate_pid(RR, **SIMULATION | {"samples": 2.0}), "samples is 2.0; it must be a whole number"),
    (lambda: ad.simulate_pid(RR, **SIMULATION | {"duration": "1"}), "duration is '1'; it must be a number .s."),
    (lambda: ad.simulate_pid(RR, **SIMULATION | {"q_start": None}), "q_start is None"),
    (lambda: ad.Dynamics("rr"), "robot is 'rr'"),
    (lambda: ad.Robot(RR.model), "Robot.* is no way to make one: use Robot.from_library"),
    (lambda: ad.Robot.from_urdf(CART), "path: looks like URDF text: use Robot.from_urdf_string"),
    (lambda: ad.Robot.from_urdf(None), "path: is None; it must be the path of a URDF file"),
    (lambda: ad.Robot.from_urdf_string("arm.urdf"), "'arm.urdf' is no URDF text; Robot.from_urdf takes the path"),
    (lambda: ad.Robot.from_urdf_string(CART.encode()), "URDF text: is b'.*; it must be the text of a URDF"),
    (lambda: ad.Robot.from_spec("rr"), "spec is 'rr'; it must be an ArmSpec: such as ArmSpec.paper"),
    (lambda: ad.Robot.from_urdf_string(two_links(), 0.1), "payload is 0.1; it must be a Payload: Payload.mass="),
    (lambda: ad.Robot.from_urdf_string(two_links(), arm="ab"), "arm is 'ab'; it must be a list"),
    (lambda: ad.Robot.from_urdf_string(two_links(), package_dirs="here"), "package_dirs is 'here'; it must be a list"),
    (lambda: ad.ArmSpec(name="a", links=[LINK]), r"links\[0\] of an arm is .* must be a LinkSpec"),
    (lambda: ad.ArmSpec(name="a\0", links=[ad.LinkSpec(**LINK)]), "a URDF can have no such characters"),
    (lambda: ad.Payload(mass="1"), "payload mass is '1'; it must be a number .kg."),
    (lambda: ad.Trajectory([0.0, 1e-300], *[np.zeros((2, 1))] * 3), "1e-300 s after t.0.; times are at least 1e-30"),
]


@pytest.mark.parametrize(("wrong", "words"), WRONG, ids=[words[:40] for _, words in WRONG])
def test_the_argument_is_named_and_the_right_form(wrong, words):
    with pytest.raises(ArmdynError, match=words):
        wrong()


def test_numbers_are_read_as_they_are():
    for one in (2, 2.0, np.float32(2), np.int64(2), np.array(2.0), Fraction(4, 2)):
        assert arguments.number(one, "x") == 2.0
    np.testing.assert_array_equal(arguments.numbers([1, Fraction(1, 2), np.float32(2)], "x"), [1, 0.5, 2])
    given = np.array([1.0])
    assert arguments.numbers(given, "x") is not given
    assert arguments.number(np.inf, "x", finite=False) == np.inf
    assert arguments.whole(np.int8(3), "x", least=1) == 3
    with pytest.raises(SpecError, match=r"x is -1 kg; it must be finite and not negative"):
        arguments.number(np.int64(-1), "x", unit="kg", sign="not negative", error=SpecError)
    with pytest.raises(ProblemError, match="x is a int; it must be"):
        arguments.number(10**5000, "x")


def test_a_message_shows_the_beginning_of_long_values():
    assert arguments.shown("a" * 10**6).startswith("'aaa") and len(arguments.shown("a" * 10**6)) <= 100
    assert arguments.shown(list(range(10**6))) == "[0, 1, 2, 3, 4, 5, 6, 7, ...]"
    assert "Hostile" in arguments.shown(Hostile())


def test_checked_fields_are_the_results_of_their_checks():
    @dataclass(frozen=True)
    class Oven(arguments.Checked):
        trays: int = arguments.checked(arguments.whole, least=1)
        heat: float = arguments.checked(arguments.number, 180, unit="°C", sign="positive")
        name: str | None = arguments.checked(arguments.text, None)

    assert Oven(np.int8(2)) == Oven(2, 180.0) and type(Oven(np.int8(2)).trays) is int and type(Oven(2).heat) is float
    assert Oven(2).name is None and replace(Oven(2), name="a").name == "a"
    for wrong, said in (({"trays": 0}, "^trays is 0; it must be at least 1"), ({"heat": -1}, "^heat is -1 °C"),
                        ({"name": 3}, "^name is 3; it must be text"), ({"heat": None}, "^heat is None")):  # fmt: skip
        with pytest.raises(ProblemError, match=said):
            Oven(**{"trays": 1, **wrong})


def test_a_urdf_as_text_is_the_same_robot_as_its_file(file):
    text = two_links()
    read, of_text = ad.Robot.from_urdf(file(text)), ad.Robot.from_urdf_string(text)
    assert read.model_hash == of_text.model_hash and read.joint_names == of_text.joint_names
    assert of_text.source == "URDF text" and of_text.package_dirs == ()
    with pytest.raises(UrdfError, match=r"^mine: not XML"):
        ad.Robot.from_urdf_string("<robot", source="mine")


def test_lists_in_themselves_and_masks_are_refused_at_once():
    itself = [1.0]
    itself[0] = itself
    for wrong in (itself, [itself, 1.0], np.ma.masked, [np.ma.masked, 1.0], np.ma.array([1, 2], mask=[0, 1])):
        with pytest.raises(ProblemError, match="expected numbers"):
            arguments.numbers(wrong, "q")
    assert arguments.numbers(np.ma.array([1, 2]), "q").tolist() == [1.0, 2.0]  # nothing in it is masked


def test_sequences_without_end_are_refused_at_once():
    bomb = [0.0]
    for _ in range(40):
        bomb = [bomb, bomb]
    for wrong in (Unending(), [Unending()], [[1.0], Unending()], [[1.0], bomb], [1.0, bomb], range(10**9)):
        with pytest.raises(ProblemError, match="expected numbers"):
            arguments.numbers(wrong, "q")


@pytest.mark.parametrize(
    "rows", [[[1, 2], [3, 4]], [np.array([1, 2]), [3.0, 4]], [(1, 2), np.array([3, 4])], deque([range(1, 3), [3, 4]])]
)
def test_rows_are_lists_arrays_and_other_sequences(rows):
    assert arguments.numbers(rows, "q").tolist() == [[1.0, 2.0], [3.0, 4.0]]
    with pytest.raises(ProblemError, match="expected numbers"):
        arguments.numbers([*rows, [5.0]], "q")
