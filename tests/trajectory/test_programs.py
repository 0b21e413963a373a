"""Programs for controllers: read back, compiled, and run against listeners in the place of the robots' libraries."""

import ast
import json
import math
import py_compile
import re
import runpy
import sys
import types
from dataclasses import replace
from functools import partial

import numpy as np
import pytest

import armdyn as ad
from armdyn.errors import TrajectoryError
from armdyn.trajectory.formats import PandaPython, Ros2, UrRtde, UrScript
from armdyn.trajectory.interpolation import interpolated
from problems import solved

HOSTILE = ('"]\nimport os', "'''\"\"\"\\", "\u2028#{os}", "\x00;end\n")


def motion(joints, names=None):
    """A curve of a number of joints that rests at both ends."""
    t = np.linspace(0, 0.4997, 120)
    s = 10 * (t / t[-1]) ** 3 - 15 * (t / t[-1]) ** 4 + 6 * (t / t[-1]) ** 5
    ds = (30 * (t / t[-1]) ** 2 - 60 * (t / t[-1]) ** 3 + 30 * (t / t[-1]) ** 4) / t[-1]
    way = np.linspace(0.2, -0.4, joints)
    q, v = -1.0 + s[:, None] * way, ds[:, None] * way
    return ad.Trajectory(t, q, v, 0 * q, tuple(names or (f"joint{i}" for i in range(joints))), name="a\nmotion\"'")


UR, FRANKA = motion(6), motion(7)


def servoed(text):
    """Targets and the other arguments of all servoj of a program."""
    lines = re.findall(r"^  servoj\((\[[^\]]*\]), (.*)\)$", text, re.M)
    return np.array([json.loads(q) for q, _ in lines]), {rest for _, rest in lines}


@pytest.mark.parametrize(("rate", "tick"), [(500, "0.002"), (125, "0.008")])
def test_urscript_is_the_samples(rate, tick):
    samples = UR.resample(rate)
    text = UrScript().text(samples)
    targets, rest = servoed(text)
    assert rest == {f"0, 0, {tick}, 0.1, 300"}
    kept = round(0.3 * rate)
    assert len(targets) == samples.t.size - 1 + kept
    np.testing.assert_allclose(targets[: -kept or None], samples.q[1:], rtol=0, atol=5e-10)
    np.testing.assert_allclose(targets[-kept:], samples.q[-1:].repeat(kept, 0), rtol=0, atol=5e-10)
    (start,) = re.findall(r"^  movej\((\[[^\]]*\]), a=0.5, v=0.25\)$", text, re.M)
    np.testing.assert_allclose(json.loads(start), samples.q[0], atol=5e-10)
    assert "set_target_payload" not in text
    body = [line for line in text.splitlines() if not line.startswith("#")]
    assert body[0] == "def armdyn_motion():" and body[1].startswith("  movej(") and body[-2:] == ["  stopj(2)", "end"]
    assert not re.search(r"\d[eE]", "".join(body[1:-1]))  # no exponents


def test_urscript_sets_the_payload_before_it_moves():
    body = UrScript(payload=2.5, payload_com=(0, 0.01, 0.08)).text(UR.resample(500)).partition("def ")[2].splitlines()
    assert body[1] == "  set_target_payload(2.500000000, [0.000000000, 0.010000000, 0.080000000])"
    assert body[2].startswith("  movej(")


@pytest.mark.parametrize(
    ("make", "rate", "said"),
    [
        (UrScript, 100, "not 500 or 125 per second"),
        (UrScript, None, "not 500 or 125 per second"),
        (partial(UrScript, gain=99), 500, "gain is 99; URScript takes 100 to 2000"),
        (partial(UrScript, lookahead=0.3), 500, "lookahead is 0.3; URScript takes 0.03 to 0.2"),
        (partial(UrScript, payload=-1), 500, "payload is -1"),
        (partial(UrScript, payload=1, payload_com=(0, 0)), 500, "payload_com has 2 numbers"),
        (partial(UrRtde, tolerance=0), 500, "tolerance is 0 rad"),
        (PandaPython, 1000, "the motion has 6 joints; panda-python is for arms of 7"),
    ],
)
def test_motions_that_a_controller_refuses(make, rate, said):
    with pytest.raises(TrajectoryError, match=re.escape(said)):
        make().text(UR.resample(rate))


@pytest.mark.parametrize(("made", "rate", "joints"), [(UrScript, 500, 6), (UrRtde, 500, 6), (PandaPython, 1000, 7)])
def test_names_of_strangers_are_no_code(made, rate, joints, tmp_path):
    """Every name is one literal: the program without them is the one of harmless names."""
    names = (*HOSTILE, *(f"joint{i}" for i in range(len(HOSTILE), joints)))
    bad = replace(motion(joints, names), name="".join(HOSTILE))
    text = made().text(bad.resample(rate))
    assert text.isascii() and all(line.isprintable() for line in text.splitlines())
    if made is UrScript:
        code = [line for line in text.splitlines() if not line.startswith("#")]
        assert code == [line for line in made().text(motion(6).resample(500)).splitlines() if not line.startswith("#")]
        return
    assigned = {
        node.targets[0].id: node.value for node in ast.parse(text).body if isinstance(node, ast.Assign)
    }  # fmt: skip
    assert ast.literal_eval(assigned["JOINTS"]) == list(names) and ast.literal_eval(assigned["NAME"]) == bad.name
    harmless = ast.parse(made().text(motion(joints).resample(rate)))
    kinds = [
        [type(node) for node in ast.walk(tree) if not isinstance(node, ast.Constant)]
        for tree in (ast.parse(text), harmless)
    ]
    assert kinds[0] == kinds[1]


class Arm:
    """A stand-in for a library: it moves to each target at once, and records the calls in order."""

    def __init__(self, q, **faults):
        self.q, self.calls, self.faults = list(q), [], faults
        self.time = 0.0

    def __getattr__(self, name):
        if name.startswith("__"):
            raise AttributeError(name)

        def call(*arguments, **named):
            self.calls.append((name, arguments, named))
            if name in ("moveJ", "servoJ", "move_to_joint_position", "set_control"):
                self.q = list(arguments[0])
            if name == "initPeriod":
                return self.time
            if name == "waitPeriod":
                assert arguments == (self.time,)
                self.time += 1 / 500
            return self.faults.get(
                name,
                {"getActualQ": self.q, "getMostLate": 0}.get(name, not name.startswith("is") or name.startswith("isJ")),
            )

        return call

    def arguments_of(self, name):
        return [arguments for called, arguments, _ in self.calls if called == name]


def program(made, samples, folder):
    """The program's file, compiled."""
    file = folder / "program.py"
    file.write_text(made.text(samples))
    py_compile.compile(str(file), doraise=True)
    return file


def run_ur(file, arm, monkeypatch, *options):
    for module, kind in (("rtde_control", "RTDEControlInterface"), ("rtde_receive", "RTDEReceiveInterface")):
        fake = types.ModuleType(module)
        setattr(fake, kind, lambda *arguments: arm.calls.append(("connect", arguments, {})) or arm)
        monkeypatch.setitem(sys.modules, module, fake)
    monkeypatch.setattr(sys, "argv", [str(file), "10.0.0.2", *options])
    runpy.run_path(str(file), run_name="__main__")


def test_ur_rtde_sends_every_sample_at_the_rate(tmp_path, monkeypatch, capsys):
    samples = UR.resample(500)
    file = program(UrRtde(payload=1.5, payload_com=(0, 0, 0.05)), samples, tmp_path)
    arm = Arm(samples.q[0] + 0.005)
    run_ur(file, arm, monkeypatch)
    assert arm.arguments_of("connect") == [("10.0.0.2",), ("10.0.0.2", 500.0)] and not arm.arguments_of("moveJ")
    sent = arm.arguments_of("servoJ")
    np.testing.assert_array_equal([q for q, *_ in sent], [*samples.q[1:], *[samples.q[-1]] * 150])
    assert {rest for _, *rest in map(tuple, sent) for rest in [tuple(rest)]} == {(0.5, 0.5, 0.002, 0.1, 300.0)}
    assert arm.time == pytest.approx(len(sent) / 500)  # a period for each
    order = [name for name, _, _ in arm.calls]
    assert order.index("setPayload") < order.index("servoJ") and order[-3:-1] == ["servoStop", "getActualQ"]
    assert arm.arguments_of("setPayload") == [(1.5, [0.0, 0.0, 0.05])] and order[-1] == "stopScript"
    assert len(arm.arguments_of("isJointsWithinSafetyLimits")) == samples.t.size
    assert "done" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("faults", "said"),
    [
        ({"isProtectiveStopped": True}, "the arm is stopped"),
        ({"isJointsWithinSafetyLimits": False}, "outside the controller's safety limits"),
        ({"getActualQ": [9.0] * 6}, "from the start"),
    ],
)
def test_ur_rtde_refuses(faults, said, tmp_path, monkeypatch):
    samples = UR.resample(500)
    arm = Arm(samples.q[0], **faults)
    with pytest.raises(SystemExit, match=said):
        run_ur(program(UrRtde(), samples, tmp_path), arm, monkeypatch)
    assert not arm.arguments_of("servoJ") and not arm.arguments_of("moveJ") and arm.arguments_of("stopScript")


def test_ur_rtde_moves_to_the_start_only_on_request(tmp_path, monkeypatch):
    samples = UR.resample(500)
    file = program(UrRtde(tolerance=0.02), samples, tmp_path)
    away = Arm(samples.q[0] + 0.03)
    with pytest.raises(SystemExit, match=r"0\.0300 rad from the start, more than 0\.02 rad"):
        run_ur(file, away, monkeypatch)
    run_ur(file, away, monkeypatch, "--to-start")
    ((q, speed, acceleration),) = away.arguments_of("moveJ")
    assert q == samples.q[0].tolist() and speed <= 0.25 and acceleration <= 0.5


def test_ur_rtde_stops_when_the_controller_does(tmp_path, monkeypatch):
    samples = UR.resample(500)
    arm = Arm(samples.q[0], servoJ=False)
    with pytest.raises(SystemExit, match="takes no more targets"):
        run_ur(program(UrRtde(), samples, tmp_path), arm, monkeypatch)
    assert len(arm.arguments_of("servoJ")) == 1 and arm.arguments_of("servoStop") and arm.arguments_of("stopScript")


class Panda(Arm):
    """panda_py.Panda, its context and its controller at once; `late` ticks are missed at the hundredth."""

    def __init__(self, q, late=0, **faults):
        super().__init__(q, **faults)
        self.late, self.ticks = late, 0

    def create_context(self, frequency):
        self.frequency, self.ticks = frequency, 0
        return self

    def __enter__(self):
        return self

    def __exit__(self, *_):
        return False

    def ok(self):
        self.ticks += 1 + (self.late if self.ticks == 100 else 0)
        self.time = (self.ticks - 1) / self.frequency
        return True

    def get_joint_limits_lower(self):
        return self.faults.get("lower", [-3.0] * 7)

    def get_joint_limits_upper(self):
        return [3.0] * 7

    def get_robot(self):
        return self


def run_panda(file, arm, monkeypatch, *options):
    fake = types.ModuleType("panda_py")
    fake.Panda, fake.controllers = lambda host: arm, types.SimpleNamespace(JointPosition=lambda: arm)
    monkeypatch.setitem(sys.modules, "panda_py", fake)
    monkeypatch.setattr(sys, "argv", [str(file), "10.0.0.2", *options])
    runpy.run_path(str(file), run_name="__main__")


def test_panda_python_shows_every_sample_at_its_time(tmp_path, monkeypatch, capsys):
    samples = FRANKA.resample(1000)
    arm = Panda(samples.q[0])
    run_panda(program(PandaPython(payload=0.7), samples, tmp_path), arm, monkeypatch)
    shown = arm.arguments_of("set_control")
    assert arm.frequency == 1000.0 and len(shown) == samples.t.size + 500
    np.testing.assert_array_equal([q for q, _ in shown[: samples.t.size]], samples.q)
    np.testing.assert_array_equal([v for _, v in shown[: samples.t.size - 1]], samples.v[:-1])
    assert all(q == samples.q[-1].tolist() and not any(v) for q, v in shown[samples.t.size - 1 :])
    order = [name for name, _, _ in arm.calls]
    assert order[0] == "set_load" and order.index("raise_error") < order.index("start_controller")
    assert order[-1] == "stop_controller" and not arm.arguments_of("move_to_joint_position")
    assert arm.arguments_of("set_load") == [(0.7, [0.0, 0.0, 0.0], [0.0] * 9)] and "done" in capsys.readouterr().out


def test_panda_python_on_a_computer_that_is_late(tmp_path, monkeypatch):
    """The motion goes on in time; after 20 ms it is stopped."""
    samples = FRANKA.resample(1000)
    file = program(PandaPython(), samples, tmp_path)
    arm = Panda(samples.q[0], late=15)
    run_panda(file, arm, monkeypatch)
    shown = [q for q, _ in arm.arguments_of("set_control")]
    assert len(shown) == samples.t.size + 500 - 15 and shown[100] == samples.q[115].tolist()
    arm = Panda(samples.q[0], late=30)
    with pytest.raises(SystemExit, match=r"was 0\.030 s late"):
        run_panda(file, arm, monkeypatch)
    assert arm.calls[-1][0] == "stop_controller"


def test_panda_python_refuses(tmp_path, monkeypatch):
    samples = FRANKA.resample(1000)
    file = program(PandaPython(), samples, tmp_path)
    for arm, said in (
        (Panda(samples.q[0] + 0.1), "from the start"),
        (Panda(samples.q[0], lower=[0.0] * 7), "joint limits"),
    ):
        with pytest.raises(SystemExit, match=said):
            run_panda(file, arm, monkeypatch)
        assert not arm.arguments_of("set_control") and not arm.arguments_of("move_to_joint_position")
    away = Panda(samples.q[0] + 0.1)
    run_panda(file, away, monkeypatch, "--to-start")
    assert away.arguments_of("move_to_joint_position") == [(samples.q[0].tolist(),)]


@pytest.mark.parametrize("rate", [250, 1000])
def test_the_spline_of_ros2_control_is_as_far_off_as_is_said(rate):
    """The quintic between two points by a linear system of its own, at a thousand times."""
    path = solved("rr").trajectory
    samples = path.resample(rate)
    said = Ros2().deviation(samples, path)
    at = np.linspace(0, samples.t[-1], 1001)
    worst = 0.0
    for time in at:
        k = min(int(np.searchsorted(samples.t, time, side="right")) - 1, samples.t.size - 2)
        h = samples.t[k + 1] - samples.t[k]
        rows = [
            [math.comb(p, d) * math.factorial(d) * x ** max(p - d, 0) * (p >= d) for p in range(6)]
            for x in (0, h)
            for d in range(3)
        ]
        ends = [getattr(samples, what)[j] for j in (k, k + 1) for what in ("q", "v", "a")]
        spline = (time - samples.t[k]) ** np.arange(6) @ np.linalg.solve(rows, ends)
        worst = max(worst, np.abs(spline - path(path.t[0] + time).q).max())
    assert 0.9 * worst <= said <= 1.5 * worst
    with pytest.raises(TrajectoryError, match="give a higher `rate` or `tolerance`"):
        Ros2(tolerance=said / 2).deviation(samples, path)


def test_interpolation_goes_through_the_points():
    t, random = np.array([0.0, 0.1, 0.4]), np.random.default_rng(0)
    given = random.normal(size=(3, 3, 2))
    for found, wanted in zip(interpolated(t, given, t), given, strict=True):
        np.testing.assert_allclose(found, wanted, atol=1e-9)
