"""Curves at common times, jumps as jumps, and which limit a joint is on."""

import base64
from dataclasses import replace

import numpy as np
import pytest

from armdyn.models.values.joint_limits import JointLimits
from armdyn.show.page.facts import Facts
from armdyn.show.page.motions import ShownMotion, Subject, arc_lanes, motions_data, sampled_lanes
from armdyn.trajectory.value import Sample
from show.motions import HANGING, RAISED, quintic
from show.page.runs import FACTS, LIMIT, bang_bang, judged


def floats(text, kind):
    return np.frombuffer(base64.b64decode(text), dtype=kind)


def data_of(*moves, robot):
    return motions_data(moves, Subject.of(robot))


def test_jumps_stay_jumps_and_ended_motions_are_not_drawn():
    robot, first = judged()
    later = quintic(robot, HANGING["rr"], RAISED["rr"], 0.5, "slow")
    data = data_of(first, ShownMotion("slow", later, Facts()), robot=robot)
    t = floats(data["t"], "<f8")
    assert np.all(np.diff(t) > 0) and t[0] == 0 and t[-1] == 0.5
    tau = floats(data["moves"][0]["tau"], "<f4").reshape(2, -1)
    at = np.searchsorted(t, 0.08)
    assert t[at] == 0.08 and t[at + 1] == np.nextafter(0.08, 1)
    assert (tau[1, at], tau[1, at + 1]) == (LIMIT, -LIMIT)
    np.testing.assert_array_equal(np.isnan(tau[0]), t > 0.21)
    q = floats(data["moves"][1]["q"], "<f4").reshape(2, -1)
    np.testing.assert_allclose(q.T, later(t).q, rtol=1e-6, atol=1e-6)  # 32-bit floats


def test_times_begin_at_zero():
    robot, _ = judged()
    motion = quintic(robot, HANGING["rr"], RAISED["rr"], 0.5)
    later = replace(motion, t=motion.t + 1.0)
    t = floats(data_of(ShownMotion("later", later, Facts()), robot=robot)["t"], "<f8")
    assert t[0] == 0 and t[-1] == pytest.approx(0.5, rel=1e-12)


def test_arcs_become_lanes_and_jumps_become_ticks():
    robot, move = judged()
    first = data_of(move, robot=robot)["moves"][0]
    assert first["resolved"]
    ends = [[(round(a, 12), round(b, 12), code) for a, b, code in lane] for lane in first["lanes"]]
    assert ends == [[(0.0, 0.12, "T+"), (0.12, 0.21, "T-")], [(0.0, 0.08, "T+"), (0.08, 0.21, "T-")]]
    assert [tick["joints"] for tick in first["switches"]] == [[1], [0]]
    assert [tick["t"] for tick in first["switches"]] == pytest.approx([0.08, 0.12], rel=1e-12)


def test_a_bare_motion_s_jumps_are_ticks_and_a_mesh_s_are_not():
    robot, move = judged()
    bare, mesh = (data_of(replace(move, facts=Facts(f)), robot=robot)["moves"][0] for f in ({}, {"arcs": []}))
    assert bare["switches"] == [{"t": 0.08, "joints": [1]}, {"t": 0.12, "joints": [0]}]
    assert mesh["switches"] == []


def test_arcs_that_are_read_off_a_mesh_are_no_exact_ones():
    robot, move = judged()
    read = Facts({**move.facts.values, "certificate": {"saving": 1e-6}})
    assert read.unresolved and not move.facts.unresolved
    known, mesh = (data_of(replace(move, facts=f), robot=robot)["moves"][0] for f in (move.facts, read))
    assert (known["exact"], mesh["exact"]) == (True, False)
    assert (mesh["lanes"], mesh["switches"]) == (known["lanes"], known["switches"])


def test_without_arcs_the_samples_say_it():
    robot, motion = bang_bang()
    robot = replace(robot, limits=replace(robot.limits, effort_lower=[-LIMIT] * 2, effort_upper=[LIMIT] * 2))
    first = data_of(ShownMotion("bare", motion, Facts()), robot=robot)["moves"][0]
    assert not first["resolved"]
    assert [[code for _, _, code in lane] for lane in first["lanes"]] == [["T+", "T-"], ["T+", "T-"]]
    assert first["lanes"][1][0][1] == pytest.approx(0.08, abs=1e-12)


def test_the_reserve_is_no_limit():
    robot, motion = bang_bang()
    limits = replace(robot.limits, effort_lower=[-LIMIT / 0.9] * 2, effort_upper=[LIMIT / 0.9] * 2)
    facts = Facts({"reserve": {"effort": [0.1, 0.1], "velocity": [0.0, 0.0]}})
    data = data_of(ShownMotion("kept", motion, facts), robot=replace(robot, limits=limits))
    assert data["kept"]["tau"] == [0.1, 0.1]
    assert [code for _, _, code in data["moves"][0]["lanes"][0]] == ["T+", "T-"]


def test_speed_position_and_passive_joints():
    t = np.linspace(0, 1, 11)
    limits = JointLimits(
        position_lower=[-1, -1, -1], position_upper=[1, 1, 1], velocity=[2, np.inf, 2],
        effort_lower=[-5, -5, 0], effort_upper=[5, 5, 0],
    )  # fmt: skip
    q = np.column_stack([0 * t, np.where(t > 0.55, -1, 0), 0 * t])
    v = np.column_stack([np.where(t < 0.45, -2, 0), 9 + 0 * t, 0 * t])
    lanes = sampled_lanes(t, Sample(q, v, 0 * q), limits)
    assert [[code for _, _, code in lane] for lane in lanes] == [["V-", ""], ["", "Q-"], ["P"]]


@pytest.mark.parametrize(
    "arcs",
    [None, [], "arcs", [{"duration": -1, "modes": ["free", "free"]}], [{"duration": 1, "modes": ["free"]}],
     [{"duration": "1", "modes": ["free", "free"]}], [3]],
)  # fmt: skip
def test_arcs_from_strangers(arcs):
    assert arc_lanes(Facts({**FACTS, "arcs": arcs}), 2) == []


def test_a_joint_is_on_its_torque_limit_at_its_speed():
    robot, _ = bang_bang()
    limits = robot.with_torque_speed({"joint1": [[0, 3], [4, 3], [16, 1]]}).limits
    t, v = np.array([0.0, 1.0, 2.0]), np.array([[0.0, 0.0], [10.0, 10.0], [10.0, 10.0]])
    lanes = sampled_lanes(t, Sample(np.zeros((3, 2)), v, np.full((3, 2), 2.0)), limits)
    assert [code for _, _, code in lanes[0]] == ["", "T+"] and [code for _, _, code in lanes[1]] == [""]
