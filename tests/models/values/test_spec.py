from dataclasses import FrozenInstanceError, replace

import numpy as np
import pytest

from armdyn.errors import SpecError
from armdyn.models import PLANAR_ARMS, ArmSpec, LinkSpec, Payload
from armdyn.paper.printed.examples import PAYLOADS

LINK = LinkSpec(length=0.5, com=0.2, mass=1.0, inertia=0.01)


def test_paper_arms_are_the_leading_links_of_table_1():
    table = [(0.250, 0.198, 0.193, 1.15e-3), (0.234, 0.143, 0.115, 4.99e-4), (0.218, 0.109, 0.100, 6.58e-4)]
    for arm in PLANAR_ARMS:
        spec = ArmSpec.paper(arm)
        assert spec.name == arm
        numbers = [(x.length, x.com, x.mass, x.inertia) for x in spec.links]
        assert numbers == table[: len(arm)]
        assert (spec.position_limit, spec.effort_limit) == (np.pi, 3.0)


def test_payloads_are_table_2():
    grams = [21.2, 31.2, 51.8, 100.6, 121.9, 130.7, 150.5, 200, 500, 1000]
    assert np.allclose(1000 * np.array(PAYLOADS), grams, rtol=1e-15, atol=0)


def test_unknown_paper_arm():
    with pytest.raises(SpecError, match="no planar arm is called 'rrrr'; known: r, rr, rrr"):
        ArmSpec.paper("rrrr")


@pytest.mark.parametrize("field", ["length", "mass", "inertia"])
@pytest.mark.parametrize("value", [0.0, -1.0, np.nan, np.inf])
def test_link_must_be_physical(field, value):
    with pytest.raises(SpecError, match=f"{field} of a link is {value}"):
        replace(LINK, **{field: value})


def test_link_com_may_be_anywhere_but_must_be_finite():
    assert replace(LINK, com=-0.1).com == -0.1
    with pytest.raises(SpecError, match="com of a link"):
        replace(LINK, com=np.nan)


@pytest.mark.parametrize("field", ["position_limit", "velocity_limit", "effort_limit"])
@pytest.mark.parametrize("value", [0.0, -1.0, np.nan, np.inf])
def test_arm_limits_must_be_positive(field, value):
    with pytest.raises(SpecError, match=field):
        ArmSpec(name="arm", links=(LINK,), **{field: value})


def test_arm_needs_a_link():
    with pytest.raises(SpecError, match="at least one link"):
        ArmSpec(name="none", links=())


def test_links_are_kept_as_a_tuple():
    assert ArmSpec(name="arm", links=[LINK]).links == (LINK,)


def test_specs_are_values():
    assert ArmSpec.paper("rr") == ArmSpec.paper("rr")
    assert hash(ArmSpec.paper("rr")) == hash(ArmSpec.paper("rr"))
    with pytest.raises(FrozenInstanceError):
        LINK.mass = 2.0


@pytest.mark.parametrize("mass", [-0.1, np.nan, np.inf])
def test_payload_mass(mass):
    with pytest.raises(SpecError, match="payload mass"):
        Payload(mass=mass)


@pytest.mark.parametrize("field", ["com", "inertia"])
@pytest.mark.parametrize("value", [(0, 0), (0, 0, np.nan), (0, 0, 0, 0)])
def test_payload_vectors_are_three_finite_numbers(field, value):
    with pytest.raises(SpecError, match=f"payload {field}"):
        Payload(mass=1.0, **{field: value})


@pytest.mark.parametrize("inertia", [(-1, 1, 1), (1, 1, 3), (0, 0, 1), (1, 1, 1, 0.8, 0.8, 0.8)])
def test_payload_inertia_is_that_of_a_body(inertia):
    with pytest.raises(SpecError, match="triangle inequality"):
        Payload(mass=1.0, inertia=inertia)


def test_payload_inertia_as_a_matrix():
    matrix = [[3.0, 0.1, 0.2], [0.1, 4.0, -0.3], [0.2, -0.3, 5.0]]
    payload = Payload(mass=1.0, inertia=matrix)
    assert payload.inertia == (3.0, 4.0, 5.0, 0.1, 0.2, -0.3)
    assert payload == Payload(mass=1.0, inertia=payload.inertia) == replace(payload)
    assert np.array_equal(payload.tensor, matrix)
    with pytest.raises(SpecError, match="symmetric"):
        Payload(mass=1.0, inertia=np.triu(matrix))


def test_payload_inertia_of_a_thin_rod_is_allowed():
    assert Payload(mass=1.0, inertia=(0, 1, 1)).inertia == (0.0, 1.0, 1.0)


@pytest.mark.parametrize("arm", PLANAR_ARMS)
def test_payload_at_last_com(arm):
    spec = ArmSpec.paper(arm)
    payload = Payload.at_last_com(spec, 0.2)
    assert spec.links[-1].length + payload.com[0] == pytest.approx(spec.links[-1].com, abs=1e-16)
    assert (payload.mass, payload.inertia) == (0.2, (0.0, 0.0, 0.0))
