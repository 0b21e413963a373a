"""Shooting on switching times: a closed form, a published benchmark, and what a failure says."""

from dataclasses import replace

import numpy as np
import pytest

import armdyn as ad
from armdyn.optimal.arcs.arc import Arc, Mode
from armdyn.optimal.indirect.canonical import canonical_system
from armdyn.optimal.indirect.shooting import BangBang, ShootingProblem, guess_arcs, shoot
from armdyn.optimal.problem.status import Status
from armdyn.optimal.problem.stop import Stop
from problems import cart, luus_problem

TOLERANCE = 1e-10


def cart_problem(folder):
    """1 kg, 1 N, 2 m."""
    ends = np.array([0.0, 0.0]), np.array([2.0, 0.0])
    return ShootingProblem(
        canonical_system(cart()), *ends, np.array([-1.0]), np.array([1.0]), TOLERANCE, Stop()
    )  # fmt: skip


def cart_guess(modes=(Mode.UPPER, Mode.LOWER), durations=(1.0, 2.0)):
    arcs = tuple(Arc(d, (mode,)) for d, mode in zip(durations, modes, strict=True))
    return BangBang(arcs, (0,), np.array([[0.0, 0.0, -1.0, -1.0], [1.0, 1.0, -1.0, 0.0]]))


def test_double_integrator_in_closed_form(tmp_path):
    found = shoot(cart_problem(tmp_path), cart_guess())
    assert found.status is Status.SOLVED, found.message
    # t_f = 2 √2, half of it on each limit; ρ = ∂(time to go)/∂x.
    np.testing.assert_allclose([arc.duration for arc in found.arcs], np.sqrt(2), rtol=1e-10)
    np.testing.assert_allclose(found.starts[0, 2:], [-1 / np.sqrt(2), -1.0], rtol=1e-9)
    assert found.wrong_sign < 1e-9  # S is zero at the switch but for the tolerance
    t, y = found.t[0], found.y[0]
    np.testing.assert_allclose(y[:, 0], t**2 / 2, atol=1e-12)


def test_arcs_are_read_from_the_signs_of_s(tmp_path):
    t = np.linspace(0, 3, 7)
    y = np.array([0 * t, 0 * t, -1 + 0 * t, t - 1.2])
    guess = guess_arcs(cart_problem(tmp_path), t, y)
    assert [arc.modes for arc in guess.arcs] == [(Mode.UPPER,), (Mode.LOWER,)]
    np.testing.assert_allclose([arc.duration for arc in guess.arcs], [1.2, 1.8], rtol=1e-12)  # S = ρ_v is linear
    np.testing.assert_allclose(guess.starts[1], [0, 0, -1, 0], atol=1e-12)
    assert guess.switches == (0,)


def test_a_way_that_the_modes_cannot_go_is_no_solution(tmp_path):
    found = shoot(cart_problem(tmp_path), cart_guess(modes=(Mode.LOWER, Mode.UPPER)))
    assert found.status in (Status.FAILED, Status.ITERATION_LIMIT)
    assert "switching" in found.message or "Newton" in found.message


def test_a_stop_is_told(tmp_path):
    late = shoot(replace(cart_problem(tmp_path), stop=Stop(deadline=0.0)), cart_guess())
    assert late.status is Status.TIME_LIMIT


def test_luus_switching_times(tmp_path):
    problem = luus_problem()
    direct = ad.solve_minimum_time(problem)
    found = ad.optimal.solve_indirect(problem, direct)
    assert found.success, found.message
    starts = np.cumsum([arc.duration for arc in found.arcs])[:-1]
    # An independent computation, to eight digits.
    np.testing.assert_allclose(starts, [0.94314035, 1.49113997, 2.62754505], atol=1e-8)
    assert found.duration == pytest.approx(direct.duration, rel=1e-9)
