"""Values are one line in a notebook's cell, with any content."""

import dataclasses
import inspect

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import armdyn as ad
from armdyn.reprs import (
    MOST_LETTERS,
    brief,
    called,
    joint_unit,
    line_of,
    more_payload,
    percent,
    several_numbers,
    short_time,
)
from problems import POSES

SIMPLE = {"float", "int", "str", "bool", "Literal", "None", "NoneType", "tuple", "Form", "Status"}


@brief
@dataclasses.dataclass(frozen=True)
class Value:
    name: str
    few: np.ndarray
    many: np.ndarray
    inside: object = None
    usual: float = 1.5


def test_a_line_has_names_shapes_and_unusual_fields():
    value = Value("arm", np.array([1.0, -0.123456]), np.zeros((100, 3)))
    assert repr(value) == "Value(name='arm', few=[1, -0.1235], many=array(100, 3))"
    assert "usual=2.5" in repr(dataclasses.replace(value, usual=2.5))
    assert "inside=Value('arm')" in repr(dataclasses.replace(value, inside=value))


def test_arrays_in_a_few_letters():
    assert several_numbers(np.float64(2)) == "2"
    assert several_numbers(np.array([[1.0, 2.0], [3.0, 4.0]])) == "[[1, 2], [3, 4]]"
    assert several_numbers(np.zeros(9)) == "array(9,)"
    assert several_numbers(np.array("text")) == "array('text', dtype='<U4')"


def is_line(text):
    return len(text) <= MOST_LETTERS and len(text.splitlines()) == 1 and text.isprintable()


@given(st.text(max_size=300), st.lists(st.text(max_size=50), max_size=20))
def test_with_any_names_it_is_one_line(name, more):
    for value in (Value(name, np.zeros(3), np.zeros(3)), Value(name, np.zeros(2), np.zeros(2), tuple(more))):
        assert is_line(repr(value))
    assert is_line(called(name))


@settings(max_examples=40, deadline=None)  # each reads a URDF
@given(
    st.text(st.characters(exclude_categories=["Cc", "Cs"], exclude_characters="\ufffe\uffff"), min_size=1),
    st.integers(1, 6),
)
def test_a_robot_is_one_line(name, joints):
    try:
        links = tuple(ad.LinkSpec(length=1.0, com=0.5, mass=1.0, inertia=0.1) for _ in range(joints))
        robot = ad.Robot.from_spec(ad.ArmSpec(name=name, links=links), ad.Payload(mass=1.0))
    except ad.ArmdynError:  # names that XML has no way to say
        return
    assert is_line(repr(robot)) and f"{joints} joint" in repr(robot)
    problem = ad.MinimumTimeProblem(
        robot, q_start=np.zeros(joints), q_goal=np.full(joints, 0.1), effort_limit=1e4, via=[np.full(joints, 0.05)]
    )
    assert is_line(repr(problem)) and "via points" in repr(problem)


@pytest.mark.parametrize("name", ["panda", "ur5", "talos_arm", "cart_pole"])
def test_robots_of_the_library_are_one_line(name):
    robot = ad.Robot.from_library(name)
    assert is_line(repr(robot)) and is_line(repr(robot.limits)) and is_line(repr(robot.friction))
    assert repr(robot) == str(robot)


@pytest.fixture(scope="module")
def solution():
    robot = ad.Robot.from_spec(ad.ArmSpec.paper("rr"))
    start, goal = POSES["rr"]
    problem = ad.MinimumTimeProblem(robot, q_start=start, q_goal=goal)
    return ad.solve_minimum_time(problem, ad.MinimumTimeOptions(search="quick"))


def test_a_solution_is_one_line_and_so_is_all_that_it_has(solution):
    assert repr(solution) == f"<Solution 'rr': {solution.duration:.6g} s, locally optimal (Pontryagin)>"
    for field in dataclasses.fields(solution):
        content = getattr(solution, field.name)
        if dataclasses.is_dataclass(content):
            assert is_line(repr(content)), field.name
    assert is_line(repr(solution.sensitivities())) and is_line(repr(solution.arcs[0]))


def test_runs_are_one_line(solution):
    run = ad.track(solution.problem.robot, solution.trajectory, ad.Lqr(), duration=0.5)
    assert is_line(repr(run)) and "2 joints" in repr(run.trajectory)
    paper = ad.simulate_pid(solution.problem.robot, q_start=[0, 0], q_goal=[0.1, 0.1], duration=0.2)
    assert is_line(repr(paper)) and "not settled" in repr(paper)


def public_dataclasses():
    found = [(name, getattr(ad, name)) for name in ad.__all__]
    return [(name, value) for name, value in found if isinstance(value, type) and dataclasses.is_dataclass(value)]


@pytest.mark.parametrize(("name", "cls"), public_dataclasses())
def test_public_values_with_arrays_are_brief(name, cls):
    """Values of plain numbers and texts may have @dataclass's own repr, which is short."""
    types = " ".join(str(field.type) for field in dataclasses.fields(cls))
    if any(word in types for word in ("Array", "ndarray", "Trajectory", "Robot", "Solution")):
        assert cls.__repr__ is line_of, name


def callables():
    for name in ad.__all__:
        value = getattr(ad, name)
        if not callable(value):
            continue
        yield name, value
        if isinstance(value, type):
            yield from ((f"{name}.{key}", getattr(value, key)) for key in dir(value) if not key.startswith("_"))


@pytest.mark.parametrize(("name", "value"), [pair for pair in callables() if callable(pair[1])])
def test_signatures_have_nothing_of_the_insides_of_numpy(name, value):
    try:
        shown = str(inspect.signature(value))
    except (TypeError, ValueError):  # of C, or an exception's
        return
    assert "numpy" not in shown and "_typing" not in shown and "_Supports" not in shown


@pytest.mark.parametrize(
    ("part", "said"),
    [
        (3.701e-4, "0.0371 %"),
        (0.005, "0.5 %"),
        (1.02 / 1 - 1, "2 %"),
        (0.05004, "5.01 %"),
        (0.0, "0 %"),
        (1.5, "150 %"),
        (12.345, "1240 %"),
        (-0.01, "-1 %"),
        (np.inf, "inf %"),
    ],
)
def test_per_cent_are_rounded_up(part, said):
    assert percent(part) == said


def test_short_times_have_no_exponent():
    assert [short_time(x, 2) for x in (0.137, 4e-5, 30.0, 1234.0)] == ["140 ms", "0.04 ms", "30 s", "1200 s"]


@pytest.mark.parametrize(
    ("per_gram", "duration", "said"),
    [
        (0.35, 0.21, "1 g"),
        (22.3, 0.045, "1 mg"),
        (3.24e-5, 1.33, "1 kg"),
        (-0.35, 0.21, "1 g"),
        (0.0, 0.3, "1 g"),
        (1e-300, -1.0, "1 g"),
    ],
)
def test_more_payload_is_little_for_the_arm(per_gram, duration, said):
    more, cost = more_payload(per_gram, duration)
    assert more == f"{said} more at the tip" and abs(cost) <= 10 * abs(duration)
    assert cost == pytest.approx(per_gram * {"1 mg": 1e-3, "1 g": 1, "1 kg": 1e3}[said])


@pytest.mark.parametrize(("slides", "unit"), [([0, 0], "rad"), ([True], "m"), ([1, 0], "rad or m"), ([], "rad or m")])
def test_positions_have_the_unit_of_their_joints(slides, unit):
    assert joint_unit(slides) == unit
