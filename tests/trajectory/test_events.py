"""Motions of several pieces in every format: events, and loads that change."""

import ast
import csv
import json
import re
from dataclasses import replace

import numpy as np
import pytest
import yaml

import armdyn as ad
from armdyn.errors import TrajectoryError
from armdyn.trajectory.formats import FORMATS, PandaPython, Ros2, UrRtde, UrScript
from armdyn.trajectory.planned import read_planned
from problems import pick_and_place
from trajectory.test_programs import HOSTILE, Arm, Panda, motion, program, run_panda, run_ur, servoed

EMPTY = ad.Load(0.0, frame="tip", at_flange=ad.Load(0.5, (0, 0, 0.05), frame="tool0"))
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


def test_the_events_of_ros2_stand_beside_the_message(tmp_path):
    samples = UR.resample(250)
    text = Ros2().text(samples)
    told = json.loads(text)
    assert told == yaml.safe_load(text)  # no 1e-05 that PyYAML takes for text
    events = told.pop("events")
    assert told == samples.to_joint_trajectory() and "events" not in json.loads(Ros2().text(motion(6).resample(250)))
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


def test_urscript_sets_the_payload_at_the_grasp():
    samples = UR.resample(500)
    text = UrScript(lookahead=0.1, transition=0.2).text(samples)
    targets, _ = servoed(text)
    np.testing.assert_allclose(targets[: samples.t.size - 1], samples.q[1:], rtol=0, atol=5e-10)
    lines = text.partition("def armdyn_motion():")[2].splitlines()
    first, grasp = [k for k, line in enumerate(lines) if "set_target_payload" in line]
    assert lines[first] == (
        "  set_target_payload(0.500000000, [0.000000000, 0.000000000, 0.050000000], "
        + f"[{', '.join(['0.000000000'] * 6)}])"
    )
    assert lines[first + 1].startswith("  movej(")
    assert lines[grasp].endswith(
        "[0.001000000, 0.002000000, 0.003000000, 0.000010000, 0.000000000, 0.000000000], 0.200000000)"
    )
    assert lines[grasp - 1] == '  armdyn_event("grasp", "part A")'
    before = sum(line.startswith("  servoj(") for line in lines[:grasp])
    assert before == samples.piece_rows[1] + 50  # a lookahead of 0.1 s later: the arm is there by then
    assert "  def armdyn_event(kind, name):" in lines and lines.count("  end") == 1
    assert "transition" not in text and "0.200000000)" not in UrScript().text(samples)
    assert "armdyn_event" not in UrScript().text(motion(6).resample(500))


def test_ur_rtde_sets_the_payload_at_the_grasp(tmp_path, monkeypatch, capsys):
    samples = UR.resample(500)
    arm = Arm(samples.q[0])
    run_ur(program(UrRtde(), samples, tmp_path), arm, monkeypatch)
    assert arm.told("setTargetPayload") == [(0.5, [0, 0, 0.05], [0.0] * 6), GRASP]
    order = [name for name, _, _ in arm.calls]
    first, grasp = [k for k, name in enumerate(order) if name == "setTargetPayload"]
    assert first < order.index("servoJ") and order[:grasp].count("servoJ") == samples.piece_rows[1] + 50
    assert "grasp part A" in capsys.readouterr().out
    with pytest.raises(TrajectoryError, match="transition is of urscript"):
        UrRtde(transition=0.1).text(samples)


def test_panda_python_takes_a_load_at_rest_without_a_controller(tmp_path, monkeypatch, capsys):
    samples = FRANKA.resample(1000)
    arm = Panda(samples.q[0])
    run_panda(program(PandaPython(), samples, tmp_path), arm, monkeypatch)
    matrix = [1e-3, 1e-5, 0.0, 1e-5, 2e-3, 0.0, 0.0, 0.0, 3e-3]
    assert arm.told("set_load") == [(0.5, [0, 0, 0.05], [0.0] * 9), (1.5, [0, 0, 0.1], matrix)]
    order = [name for name, _, _ in arm.calls if name not in ("set_control", "raise_error")]
    run = ["start_controller", "stop_controller"]
    assert order == ["set_load", *run, "set_load", *run]
    shown, row = arm.told("set_control"), samples.piece_rows[1]
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
    ("made", "moved", "said"),
    [
        (UrScript(payload=1.0), UR, "`payload` is of motions whose payload does not change"),
        (UrScript(transition=-1), UR, "transition is -1 s"),
        (UrScript(), cycle(6, part=ad.Load(1.0, frame="ee_link")), "a load of 1 kg is in the frame 'ee_link'; ur"),
        (UrRtde(), cycle(6, part=ad.Load(1.0, frame="ee_link")), "ur-rtde takes it in that of the flange, tool0"),
        (PandaPython(), cycle(7), "panda-python takes it in that of the flange, link8"),
    ],
)  # fmt: skip
def test_loads_that_a_controller_does_not_take(made, moved, said):
    with pytest.raises(TrajectoryError, match=re.escape(said)):
        made.text(moved.resample(made.rate))


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
    told = {node.targets[0].id: node.value for node in ast.parse(text).body if isinstance(node, ast.Assign)}
    ((_, kind, name, load),) = ast.literal_eval(told["EVENTS"])
    assert (kind, name, load) == (bad, bad, None)


@pytest.mark.parametrize("name", FORMATS)
def test_a_motion_of_an_armdyn_solution_in_every_format(name):
    """Loads of `load_of` are what the formats take."""
    arms = {6: ad.Robot.from_library("ur5"), 7: ad.Robot.from_library("panda")}
    kind = FORMATS[name]
    joints = 7 if name == "panda-python" else 6
    _, moved = pick_and_place(arms[joints], (0.0,) * joints, (0.3,) * joints, 1.0, 0.4)
    samples = (moved.split()[2] if name == "mujoco" else moved).resample(getattr(kind, "rate", 1000.0))
    assert kind().text(samples)
