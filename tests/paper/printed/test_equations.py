import numpy as np
import pytest
from scipy.integrate import solve_ivp

from armdyn.errors import SpecError
from armdyn.models import ArmSpec, LinkSpec, Payload
from armdyn.models.values.spec import GRAVITY
from armdyn.paper.closed_form import PlanarArm
from armdyn.paper.printed.equations import PrintedArm
from oracles import assert_close, random_states

TOLERANCE = 1e-14  # the same sums in another order
RRR = ArmSpec.paper("rrr")
Q = np.array([0.4, -0.7, 1.1])
V = np.array([1.3, -0.6, 0.9])


def with_coms_at_half_length(spec):
    """The arm that (7) silently describes."""
    links = [LinkSpec(length=x.length, com=x.length / 2, mass=x.mass, inertia=x.inertia) for x in spec.links]
    return ArmSpec(name=spec.name, links=tuple(links))


@pytest.mark.parametrize("arm", ["r", "rr"])
@pytest.mark.parametrize("mass", [0.0, 0.1006, 1.0])
def test_equations_5_and_6_are_mechanics(arm, mass):
    spec = ArmSpec.paper(arm)
    printed = PrintedArm.from_spec(spec, mass)
    right = PlanarArm.from_spec(spec, Payload.at_last_com(spec, mass))
    for q, v, _ in random_states(len(arm)):
        assert_close(printed.inertia(q), right.inertia(q), TOLERANCE)
        assert_close(printed.coriolis(q, v), right.coriolis(q, v), TOLERANCE)
        assert_close(printed.gravity(q), right.gravity(q), TOLERANCE)


def test_equation_7_with_numbers_worked_out_by_hand():
    # L = m = I = lc = 1 (and 2 for the third length) leave whole numbers at q = 0.
    one = LinkSpec(length=1.0, com=1.0, mass=1.0, inertia=1.0)
    arm = PrintedArm.from_spec(
        ArmSpec(name="ones", links=(one, one, LinkSpec(length=2.0, com=1.0, mass=1.0, inertia=1.0)))
    )
    d11 = 3 + 0.25 + (1 + 0.25 + 1) + (1 + 1 + 1 + 4 + 2 + 2)
    d12 = 2 + 0.5 * (0.5 + 1) + (2 + 2 + 2 + 2 + 4)
    d13 = 1 + 0.5 * (2 + 2 + 2)
    d22, d23, d33 = 2 + 0.25 + (1 + 1 + 2), 1 + 0.5 * (4 + 2), 1 + 1
    assert_close(arm.inertia(np.zeros(3)), [[d11, d12, d13], [0, d22, d23], [0, 0, d33]], TOLERANCE)
    assert_close(arm.gravity(np.zeros(3)), GRAVITY * np.array([0.5 + 1.5 + 3, 0.5 + 2, 1]), TOLERANCE)
    # q2 = pi/2, q3 = 0, v = (1, 2, 4): s2 = s23 = 1, s3 = 0.
    c12 = -0.5 * (1 + 2 + 2) - (2 + 4 + 4) - 2 * (0.5 + 2 + 2) - 0.5 * 4
    c22 = 0.5 * (0.5 + 2 + 2)
    quarter = np.array([0, np.pi / 2, 0])
    assert_close(arm.coriolis(quarter, np.array([1, 2, 4])), [[0, c12, 0], [0, c22, 0], [0, c22, 0]], TOLERANCE)
    # q2 = -pi/2, q3 = pi/2: s2 = -1, s23 = 0, s3 = 1.
    c12 = 0.5 * (1 + 2 + 2) + (2 + 4 + 4)
    c13 = 2 * (-0.5 * (1 + 4) - 0.5 - 0.75 * 2)
    c22, c23 = -0.5 * 2.5, 2 * (-0.5 * (0.5 + 2 + 4) + 0.25)
    c33 = 0.5 * (1 - 2)
    bent = np.array([0, -np.pi / 2, np.pi / 2])
    assert_close(arm.coriolis(bent, np.array([1, 2, 4])), [[0, c12, c13], [0, c22, c23], [0, c22, c33]], TOLERANCE)


def test_equation_7_departs_from_the_mechanics_it_describes():
    """Entries at fault even where l_c = L/2, which (7) presumes: d22, d33 and g alone are right."""
    spec = with_coms_at_half_length(RRR)
    printed, right = PrintedArm.from_spec(spec), PlanarArm.from_spec(spec)
    wrong = ~np.isclose(printed.inertia(Q), right.inertia(Q), rtol=1e-9, atol=0)
    assert wrong.tolist() == [[True, True, True], [True, False, True], [True, True, False]]
    assert_close(printed.gravity(Q), right.gravity(Q), TOLERANCE)
    departs = ~np.isclose(printed.coriolis(Q, V) @ V, right.coriolis(Q, V) @ V, rtol=1e-3)
    assert departs.all()


def test_equation_7_with_the_errata_is_mechanics():
    """The corrections of each term of D, added to the printed one, give the hand-derived D."""
    spec = with_coms_at_half_length(RRR)
    printed, right = PrintedArm.from_spec(spec), PlanarArm.from_spec(spec)
    (_, m2, m3), (L1, L2, L3), (lc1, lc2, _) = printed.mass, printed.length, printed.com
    I3 = printed.inertia_about_com[2]
    c2, c3, c23 = np.cos(Q[1]), np.cos(Q[2]), np.cos(Q[1] + Q[2])
    D = printed.inertia(Q)
    D[0, 0] += m2 * (L1**2 - lc1**2) + m3 * (2 * L1 * (L2 - L3) * c2 + (L2 - L1) * L3 * c3)
    bracket = 2 * L2**2 + L3**2 / 2 + 2 * L1 * L2 * c2 + L1 * L3 * c23 + 2 * L2 * L3 * c3
    D[0, 1] += m2 * (L2**2 - lc2**2) / 4 - m3 * bracket / 2
    D[0, 2] = I3 + m3 * (L3**2 / 2 + L1 * L3 * c23 + L2 * L3 * c3) / 2
    D[1, 2] -= m3 * L3**2 / 4
    D = np.triu(D) + np.triu(D, 1).T
    assert_close(D, right.inertia(Q), TOLERANCE)


def test_equation_7_ignores_the_centres_of_mass_of_table_1():
    printed, right = PrintedArm.from_spec(RRR), PlanarArm.from_spec(RRR)
    at_half = PlanarArm.from_spec(with_coms_at_half_length(RRR))
    assert_close(printed.gravity(Q), at_half.gravity(Q), TOLERANCE)
    assert np.max(np.abs(printed.gravity(Q) - right.gravity(Q))) > 0.01


def test_equation_7_is_triangular_and_does_not_conserve_energy():
    spec = with_coms_at_half_length(RRR)
    printed = PrintedArm.from_spec(spec)
    assert not np.any(np.tril(printed.inertia(Q), -1))

    def drift(arm):
        def rhs(_, x):
            q, v = x[:3], x[3:]
            return np.concatenate((v, np.linalg.solve(arm.inertia(q), -arm.coriolis(q, v) @ v - arm.gravity(q))))

        def energy(x):
            right = PlanarArm.from_spec(spec)
            heights = np.sin(np.cumsum(x[:3]))  # g = dP/dq, so P = sum of g's terms with sin for cos
            moments = right.gravity(np.zeros(3))
            own = moments - np.append(moments[1:], 0)
            return x[3:] @ right.inertia(x[:3]) @ x[3:] / 2 + own @ heights

        path = solve_ivp(rhs, (0, 0.3), np.concatenate((Q, V)), method="DOP853", rtol=1e-10, atol=1e-10)
        return np.ptp([energy(x) for x in path.y.T])

    assert drift(PlanarArm.from_spec(spec)) < 1e-8  # the integrator's 1e-10 per step, over its steps
    assert drift(printed) > 1e-3


def test_payload_adds_to_the_last_mass_alone():
    plain, loaded = PrintedArm.from_spec(RRR), PrintedArm.from_spec(RRR, 0.5)
    assert loaded.mass == (*plain.mass[:2], plain.mass[2] + 0.5)
    assert (loaded.com, loaded.inertia_about_com) == (plain.com, plain.inertia_about_com)


def test_bad_input_is_refused():
    four = ArmSpec(name="four", links=(*RRR.links, RRR.links[0]))
    with pytest.raises(SpecError, match="one to three"):
        PrintedArm.from_spec(four)
    for mass in (-1.0, np.nan):
        with pytest.raises(SpecError, match="payload mass"):
            PrintedArm.from_spec(RRR, mass)
    with pytest.raises(SpecError, match="expected 3 numbers"):
        PrintedArm.from_spec(RRR).gravity([0.0])
