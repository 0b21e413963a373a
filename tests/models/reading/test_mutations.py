"""Property: any mutated URDF gives a robot or an ArmdynError, soon."""

import time

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from armdyn.errors import ArmdynError
from armdyn.models import ArmSpec, Payload, Robot, urdf_from_spec
from armdyn.models.robots.library import library_urdf
from mutations import mutated

BOUNDED = settings(max_examples=60, suppress_health_check=[HealthCheck.function_scoped_fixture])
RR = urdf_from_spec(ArmSpec.paper("rr"), Payload(mass=0.1))


def check(path, **options):
    started = time.process_time()
    try:
        robot = Robot.from_urdf(path, **options)
    except ArmdynError as error:
        assert str(error) and len(str(error)) < 2000
        return False
    finally:
        assert time.process_time() - started < 10.0  # measured: below 0.7 s for any of 10,000
    limits, n = robot.limits, robot.nv
    assert n == len(robot.joint_names) >= 1
    assert np.all(limits.velocity > 0) and np.all(limits.effort_upper >= 0)
    assert np.all(limits.position_lower <= limits.position_upper)
    torque = pin.rnea(robot.model, robot.model.createData(), pin.neutral(robot.model), *np.ones((2, n)))
    assert np.all(np.isfinite(torque))
    assert robot.frame(robot.tip).name == robot.tip
    return True


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::armdyn.errors.ArmdynWarning")  # of arms and grippers that mutations make
@pytest.mark.parametrize("base", ["rr", "ur5", "panda"])
@BOUNDED
@given(choice=st.randoms(use_true_random=False))
def test_mutated(base, tmp_path, choice):
    text = RR if base == "rr" else library_urdf(base)[0].read_text()
    path = tmp_path / "mutated.urdf"
    path.write_bytes(mutated(text, choice))
    check(path, lock={"panda_finger_joint1": 0.0} if base == "panda" else None)


NUMBER = st.one_of(
    st.floats(allow_nan=True, allow_infinity=True).map(repr), st.text(max_size=6), st.integers().map(str)
).filter(lambda text: text.isprintable())


@pytest.mark.slow
@BOUNDED
@given(
    attribute=st.sampled_from(["mass value=", "ixx=", "iyz=", "effort=", "velocity=", "lower=", "upper="]), to=NUMBER
)
def test_any_number_anywhere(attribute, to, tmp_path):
    head, _, tail = RR.partition(f'{attribute}"')
    assert tail
    escaped = to.replace("&", "&amp;").replace("<", "&lt;").replace('"', "&quot;")
    path = tmp_path / "number.urdf"
    path.write_text(f'{head}{attribute}"{escaped}{tail[tail.index(chr(34)) :]}', encoding="utf-8")
    check(path)


@BOUNDED
@given(text=st.text(max_size=200))
def test_any_text(text, tmp_path):
    path = tmp_path / "text.urdf"
    path.write_bytes(text.encode(errors="surrogatepass"))
    assert not check(path)


@BOUNDED
@given(joint=st.text(min_size=1, max_size=20), link=st.text(min_size=1, max_size=20))
def test_any_name(joint, link, tmp_path):
    escape = {ord(c): f"&#{ord(c)};" for c in '<&"\t\n\r'}
    path = tmp_path / "names.urdf"
    text = RR.replace('"joint1"', f'"{joint.translate(escape)}"').replace('"link1"', f'"{link.translate(escape)}"')
    path.write_bytes(text.encode(errors="surrogatepass"))
    check(path)
    check(path, lock={"joint2": 0.1})


def test_the_base_itself_is_read(tmp_path):
    path = tmp_path / "rr.urdf"
    path.write_text(RR)
    assert check(path)
