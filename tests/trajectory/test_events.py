"""Motions of several pieces in every format: events, and loads that change."""

import ast
import csv
import json
import re
from dataclasses import replace
from functools import partial

import numpy as np
import pinocchio as pin
import pytest
import yaml

import armdyn as ad
from armdyn.errors import TrajectoryError
from armdyn.trajectory.formats import FORMATS, PandaPython, Ros2, UrRtde, UrScript
from armdyn.trajectory.planned import read_planned
from problems import pick_and_place
from trajectory.test_programs import HOSTILE, Arm, Panda, motion, program, run_panda, run_ur, servoed

EMPTY = ad.Load(0.0, frame="tip", at_flange=ad.Load(0.0, frame="tool0"))
PART = ad.Load(
    1.0, (0, 0, 0.1), frame="tip", at_flange=ad.Load(1.5, (0, 0, 0.1), (1e-3, 2e-3, 3e-3, 1e-5, 0, 0), "tool0")
)
GRASP = (1.5, [0.0, 0.0, 0.1], [1e-3, 2e-3, 3e-3, 1e-5, 0.0, 0.0])


def cycle(joints, empty=EMPTY, part=PART, name="part A", event="grasp"):
    """There, a dwell of 0.3 s with an event at its start, and back with the part."""
    there = motion(joints)
    dwell = ad.Trajectory.at_rest(there.q[-1], 0 * there.q[-1], 0.3, there.joint_names)
    back = replace(there, q=there.q[::-1], v=-there.v[::-1])
    pieces = (there, name if event else "", empty, ""), (dwell, name, part, event), (back, "back", part, "")
    first, *rest = (one.as_piece(name=called, load=load, event=kind) for one, called, load, kind in pieces)
    return sum(rest, first)


UR, FRANKA = (
    cycle(6),
    cycle(7, *(replace(one, at_flange=replace(one.at_flange, frame="panda_link8")) for one in (EMPTY, PART))),
)


def test_samples_know_their_pieces():
    late = replace(motion(6), t=motion(6).t + 5.0).as_piece()
    samples = UR.resample(500)
    assert [one.start for one in samples.pieces] == [one.start for one in UR.pieces]
    assert late.resample(500).pieces[0].start == 0.0
    rows = samples.piece_rows
    assert rows[0] == 0 and all(
        samples.t[k] >= one.start > samples.t[k - 1] for k, one in zip(rows[1:], samples.pieces[1:], strict=True)
    )
    own = UR.resample()
    assert [own.t[k] for k in own.piece_rows] == pytest.approx([one.start for one in UR.pieces], abs=1e-15)


def test_a_table_says_piece_event_and_load(tmp_path):
    samples = UR.resample(100)
    rows = list(csv.reader(samples.to_csv(tmp_path / "m.csv").open()))
    assert rows[0][-3:] == ["piece", "event", "load [kg]"]
    grasp, back = samples.piece_rows[1:]
    assert rows[1 + grasp][-3:] == ["part A", "grasp", "1.0"] and rows[2 + grasp][-3:] == ["part A", "", "1.0"]
    assert rows[grasp][-3:] == ["part A", "", "0.0"] and rows[1 + back][-3:] == ["back", "", "1.0"]
    read = read_planned(tmp_path / "m.csv", UR.joint_names)
    np.testing.assert_array_equal(read.q, samples.q)
    frame = samples.to_dataframe()
    assert list(frame.columns) == rows[0] and frame["event"][grasp] == "grasp" and frame["load [kg]"].sum() > 0
    plain = replace(UR, pieces=()).resample(100)
    assert plain.to_csv(tmp_path / "plain.csv").read_text().splitlines()[0].endswith("tau_joint5 [N m or N]")


def test_a_table_of_a_load_that_is_not_known(tmp_path):
    samples = cycle(6, None, None).resample(100)
    rows = list(csv.reader(samples.to_csv(tmp_path / "m.csv").open()))
    assert rows[1][-1] == "" and read_planned(tmp_path / "m.csv", UR.joint_names).t.size == samples.t.size


@pytest.mark.slow
def test_the_events_of_ros2_are_next_to_the_message(tmp_path):
    samples = UR.resample(250)
    text = Ros2().text(samples)
    message = json.loads(text)
    assert message == yaml.safe_load(text)  # no 1e-05 that PyYAML takes for text
    events = message.pop("events")
    assert message == samples.to_joint_trajectory() and "events" not in json.loads(Ros2().text(motion(6).resample(250)))
    start = UR.pieces[1].start
    assert events[1]["time_from_start"]["sec"] + 1e-9 * events[1]["time_from_start"]["nanosec"] == pytest.approx(
        start, abs=1e-9
    )
    assert (events[1]["name"], events[1]["event"]) == ("part A", "grasp") and set(events[0]) == set(events[1])
    assert ad.Load(**events[1]["load"] | {"at_flange": ad.Load(**events[1]["load"]["at_flange"])}) == PART
    (tmp_path / "m.json").write_text(text)
    np.testing.assert_array_equal(read_planned(tmp_path / "m.json", UR.joint_names).q, samples.q)


def test_a_model_of_mujoco_has_one_payload():
    with pytest.raises(
        TrajectoryError, match="the payload changes along the motion of 3 pieces, and a MuJoCo model has one"
    ):
        UR.resample(100).to_mjcf()
    assert "<key" in UR.split()[1].resample(100).to_mjcf()
    assert "<key" in (motion(6) + replace(motion(6), q=2 * motion(6).q[-1] - motion(6).q[::-1])).resample(100).to_mjcf()


def body(load):
    """A payload's numbers as Pinocchio's inertia."""
    mass, com, (xx, yy, zz, xy, xz, yz) = load
    return pin.Inertia(mass, np.array(com), np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]))


GRIPPER = (0.7, [0.01, -0.02, 0.05], [1e-3, 2e-3, 1.5e-3, 1e-4, -2e-4, 3e-4])
"""Set on the robot before."""


def same(found, expected):
    np.testing.assert_allclose(body(found).toDynamicParameters(), expected.toDynamicParameters(), rtol=0, atol=1e-12)


def test_urscript_adds_the_load_at_the_grasp():
    samples = UR.resample(500)
    text = UrScript(lookahead=0.1).text(samples)
    targets, _ = servoed(text)
    np.testing.assert_allclose(targets[: samples.t.size - 1], samples.q[1:], rtol=0, atol=5e-10)
    lines = text.partition("def armdyn_motion():")[2].splitlines()
    (grasp,) = [k for k, line in enumerate(lines) if "armdyn_load(" in line and "def" not in line]
    numbers = "[0.001000000, 0.002000000, 0.003000000, 0.000010000, 0.000000000, 0.000000000]"
    assert lines[grasp] == f"  armdyn_load(1.500000000, [0.000000000, 0.000000000, 0.100000000], {numbers})"
    assert lines[grasp - 1] == '  armdyn_event("grasp", "part A")'
    before = sum(line.startswith("  servoj(") for line in lines[:grasp])
    assert before == samples.piece_rows[1] + 50  # a lookahead of 0.1 s later: the arm is there by then
    assert "armdyn_event" not in UrScript().text(motion(6).resample(500))


@pytest.mark.parametrize("transition", [0.0, 0.2])
def test_urscript_makes_one_body_of_gripper_and_part(transition):
    """The function of the program, run as Python: the two languages write these lines alike."""
    text = UrScript(transition=transition).text(UR.resample(500))
    lines = text.partition("def armdyn_motion():\n")[2].partition("  movej(")[0].splitlines()
    lines = [line[2:].replace("local ", "").replace("global ", "") for line in lines if line.strip() != "end"]
    calls = []
    own = dict(
        zip(("get_target_payload", "get_target_payload_cog", "get_target_payload_inertia"), GRIPPER, strict=True)
    )
    names = {name: lambda value=value: value for name, value in own.items()}
    names |= {"set_target_payload": lambda *given: calls.append(given), "textmsg": print}
    exec("\n".join(lines), names)
    names["armdyn_load"](*GRASP)
    same(calls[0][:3], body(GRIPPER) + body(GRASP))
    assert calls[0][3:] == ((transition,) if transition else ())
    names["armdyn_load"](0.0, [0.0] * 3, [0.0] * 6)  # released
    same(calls[1][:3], body(GRIPPER))
    names["armdyn_m"] = 0
    names["armdyn_load"](0.0, [0.0] * 3, [0.0] * 6)
    assert calls[2] == (0, [0, 0, 0])


def test_urscript_with_a_load_from_the_beginning():
    text = UrScript(payload=0.5).text(cycle(6, PART, EMPTY, event="release").resample(500))
    lines = [line for line in text.splitlines() if re.match(r"  (set_target_payload|global|armdyn_load|movej)", line)]
    assert [re.match(r" *(\w+)", line)[1] for line in lines] == [
        "set_target_payload", "global", "global", "global", "armdyn_load", "movej", "armdyn_load",
    ]  # fmt: skip
    assert lines[0].startswith("  set_target_payload(0.5") and lines[-1].startswith("  armdyn_load(0.000000000,")


def test_ur_rtde_adds_the_load_at_the_grasp(tmp_path, monkeypatch, capsys):
    samples = UR.resample(500)
    own = dict(zip(("getPayload", "getPayloadCog", "getPayloadInertia"), GRIPPER, strict=True))
    arm = Arm(samples.q[0], **own)
    run_ur(program(UrRtde(), samples, tmp_path), arm, monkeypatch)
    (arguments,) = arm.arguments_of("setTargetPayload")
    same(arguments, body(GRIPPER) + body(GRASP))
    order = [name for name, _, _ in arm.calls]
    assert order[: order.index("setTargetPayload")].count("servoJ") == samples.piece_rows[1] + 50
    assert "grasp part A" in capsys.readouterr().out
    arm = Arm(samples.q[0])
    run_ur(
        program(UrRtde(payload=0.5), cycle(6, PART, EMPTY, event="release").resample(500), tmp_path), arm, monkeypatch
    )
    assert arm.arguments_of("setPayload") == [(0.5, [0.0] * 3)] and not arm.arguments_of("getPayload")
    held, released = arm.arguments_of("setTargetPayload")
    same(held, body((0.5, [0.0] * 3, [0.0] * 6)) + body(GRASP))
    assert released == (0.5, [0.0] * 3, [0.0] * 6)
    with pytest.raises(TrajectoryError, match="transition is of urscript"):
        UrRtde(transition=0.1).text(samples)


def test_panda_python_takes_a_load_at_rest_without_a_controller(tmp_path, monkeypatch, capsys):
    samples = FRANKA.resample(1000)
    arm = Panda(samples.q[0])
    run_panda(program(PandaPython(), samples, tmp_path), arm, monkeypatch)
    matrix = [1e-3, 1e-5, 0.0, 1e-5, 2e-3, 0.0, 0.0, 0.0, 3e-3]
    assert arm.arguments_of("set_load") == [(1.5, [0, 0, 0.1], matrix)]
    order = [name for name, _, _ in arm.calls if name not in ("set_control", "raise_error")]
    run = ["start_controller", "stop_controller"]
    assert order == [*run, "set_load", *run]
    shown, row = arm.arguments_of("set_control"), samples.piece_rows[1]
    assert len(shown) == samples.t.size + 1 + 2 * 500
    np.testing.assert_array_equal([q for q, _ in shown[: row + 1]], samples.q[: row + 1])
    assert not any(shown[row][1]) and not any(shown[row + 400][1])
    np.testing.assert_array_equal([q for q, _ in shown[row + 501 :]][: samples.t.size - row], samples.q[row:])
    assert "grasp part A" in capsys.readouterr().out


def test_a_franka_arm_takes_no_load_in_motion():
    moving = motion(7)
    half = 0.5 * (moving.t[60] + moving.t[61])
    first, second = moving.slice(None, half), moving.slice(half, None)
    thrown = first.as_piece(load=PART) + second.as_piece(load=ad.Load(0.0), event="release")
    with pytest.raises(
        TrajectoryError, match=r"release occurs at 0\.25.* s, where a joint moves by .* rad/s; a Franka arm"
    ):
        PandaPython().text(
            replace(thrown, pieces=(replace(thrown.pieces[0], load=None), thrown.pieces[1])).resample(1000)
        )


@pytest.mark.parametrize(
    ("make", "moved", "said"),
    [
        (partial(UrScript, transition=-1), UR, "transition is -1 s"),
        (UrScript, cycle(6, part=ad.Load(1.0, frame="ee_link")), "a load of 1 kg is in the frame 'ee_link'; ur"),
        (UrRtde, cycle(6, part=ad.Load(1.0, frame="ee_link")), "ur-rtde takes it in that of the flange, tool0"),
        (PandaPython, cycle(7), "panda-python takes it in that of the flange, link8"),
    ],
)  # fmt: skip
def test_loads_that_a_controller_does_not_take(make, moved, said):
    with pytest.raises(TrajectoryError, match=re.escape(said)):
        (made := make()).text(moved.resample(made.rate))


def test_a_payload_of_pieces_whose_loads_are_not_known():
    text = UrScript(payload=1.0).text(cycle(6, None, None).resample(500))
    assert text.count("set_target_payload") == 1 and 'armdyn_event("grasp", "part A")' in text


@pytest.mark.parametrize(("made", "rate", "joints"), [(UrScript, 500, 6), (UrRtde, 500, 6), (PandaPython, 1000, 7)])
def test_events_of_strangers_are_no_code(made, rate, joints):
    bad = "".join(HOSTILE)
    text = made().text(cycle(joints, None, None, name=bad, event=bad).resample(rate))
    assert text.isascii() and all(line.isprintable() for line in text.splitlines())
    if made is UrScript:
        (line,) = [line for line in text.splitlines() if line.startswith("  armdyn_event(")]
        assert re.fullmatch(r'  armdyn_event\("[A-Za-z0-9 _.-]*", "[A-Za-z0-9 _.-]*"\)', line)
        return
    assigned = {node.targets[0].id: node.value for node in ast.parse(text).body if isinstance(node, ast.Assign)}
    ((_, kind, name, load),) = ast.literal_eval(assigned["EVENTS"])
    assert (kind, name, load) == (bad, bad, None)


@pytest.mark.parametrize("name", FORMATS)
def test_a_motion_of_an_armdyn_solution_in_every_format(name):
    """The formats take the loads of `load_of`."""
    arms = {6: ad.Robot.from_library("ur5"), 7: ad.Robot.from_library("panda")}
    kind = FORMATS[name]
    joints = 7 if name == "panda-python" else 6
    _, moved = pick_and_place(arms[joints], (0.0,) * joints, (0.3,) * joints, 1.0, 0.4)
    samples = (moved.split()[2] if name == "mujoco" else moved).resample(getattr(kind, "rate", 1000.0))
    assert kind().text(samples)
