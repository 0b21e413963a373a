"""Section 3's first approach, equations (10) to (15): one link, linearised about -π/2, by Pontryagin.

With y = θ + π/2, cos θ ≈ y, so that (11) is a driven oscillator,

    ÿ = r y + k τ,   r = -m g l_c / (m l_c² + I) = -ω²,   k = 1 / (m l_c² + I),   |τ| ≤ τ_max,

whose phase curves in (y, ẏ/ω) are circles about ±a, a = k τ_max / ω², run clockwise at ω. From rest at
y = 0 to rest at y_f an extremal turns by φ about σa, by π about each of m centres in between, and by ψ
about -a. Both circles through the last switch say

    |(2m + 2) - exp(-iφ)| = y_f/a + 1,   m = floor(y_f / 2a),   ψ = arg((2m + 2) - exp(-iφ)),

and t_f = (φ + mπ + ψ)/ω: it switches every π/ω, not every 2π/r, and between ±τ_max, not ±k/det.
(The harmonic oscillator under bang-bang control: Pontryagin et al. 1962, section 5.)
"""

from dataclasses import dataclass
from functools import cache
from typing import Self

import numpy as np
from numpy.typing import ArrayLike
from scipy.integrate import quad

from armdyn.arrays import Array
from armdyn.errors import ProblemError
from armdyn.models.values.spec import ArmSpec, Payload
from armdyn.optimal import replay_torques
from armdyn.paper.closed_form import PlanarArm
from armdyn.paper.outcomes.case import READINGS, Case, Reading
from armdyn.paper.printed.examples import PAYLOADS
from armdyn.trajectory import Trajectory

THETA_START = -np.pi / 2
"""Where (11) is linearised, and where Example 1 starts [rad]."""


@dataclass(frozen=True)
class BangBang:
    """A torque that jumps between its limits.

    Attributes:
        switches: times of the jumps [s], increasing.
        signs: +1 or -1, one for each arc, one more than there are switches.
        duration: t_f [s].
    """

    switches: tuple[float, ...]
    signs: tuple[int, ...]
    duration: float


@dataclass(frozen=True)
class OneLink:
    """One link under gravity: J θ̈ = τ - G cos θ, equation (5).

    Attributes:
        inertia: J = m l_c² + I about the joint [kg m²].
        gravity: G = m g l_c [N m].
        torque_limit: τ_max [N m].
    """

    inertia: float
    gravity: float
    torque_limit: float

    @classmethod
    def of(cls, payload: float, reading: Reading = "tip") -> Self:
        """The paper's R arm with a payload [kg]."""
        spec = ArmSpec.paper("r")
        load = Payload(mass=payload) if reading == "tip" else Payload.at_last_com(spec, payload)
        arm = PlanarArm.from_spec(spec, load)
        return cls(float(arm.inertia([0.0])[0, 0]), float(arm.gravity([0.0])[0]), spec.effort_limit)

    @property
    def r(self) -> float:
        """Coefficient r of (11) [1/s²], negative."""
        return -self.gravity / self.inertia

    @property
    def k(self) -> float:
        """Coefficient k of (11) [1/(kg m²)]."""
        return 1 / self.inertia

    @property
    def omega(self) -> float:
        """√|r| [rad/s]."""
        return float(np.sqrt(-self.r))

    def transition(self, t: float) -> Array:
        """exp(tM) of (13), shape (2, 2), corrected: by ω = √|r|, of determinant 1.

        Args:
            t: [s].
        """
        w = self.omega
        return np.array([[np.cos(w * t), np.sin(w * t) / w], [-w * np.sin(w * t), np.cos(w * t)]])

    def flow(self, x: ArrayLike, tau: float, t: float) -> Array:
        """State (θ, θ̇) of (11) after a time under a constant torque, shape (2,).

        The affine term of (13) is (0, rπ/2): with it and kτ the oscillator turns about θ = -π/2 + τ/G.

        Args:
            x: state at the start [rad, rad/s], shape (2,).
            tau: torque [N m].
            t: [s].
        """
        centre = np.array([THETA_START + tau / self.gravity, 0.0])
        return np.asarray(centre + self.transition(t) @ (np.asarray(x, dtype=float) - centre))

    def linearised_minimum_time(self, theta_goal: float) -> BangBang:
        """Minimum time from rest at -π/2 to rest at a goal, under the linearised dynamics (11).

        Args:
            theta_goal: above -π/2 [rad].

        Raises:
            ProblemError: the goal is not above -π/2.
        """
        distance = theta_goal - THETA_START
        if not distance > 0:
            raise ProblemError(f"the goal is {theta_goal} rad; the first approach moves up from -π/2 rad")
        amplitude = self.torque_limit / self.gravity
        between = int(distance // (2 * amplitude))
        n = 2 * between + 2
        cos = (n**2 + 1 - (distance / amplitude + 1) ** 2) / (2 * n)
        phi = float(np.arccos(np.clip(cos, -1.0, 1.0)))
        psi = float(np.arctan2(np.sin(phi), n - np.cos(phi)))
        turns = np.array([phi, *[np.pi] * between, psi])
        times = np.cumsum(turns) / self.omega
        last_first = [-1 if j % 2 == 0 else 1 for j in range(len(turns))]
        return BangBang(tuple(map(float, times[:-1])), tuple(reversed(last_first)), float(times[-1]))

    def minimum_time(self, theta_start: float, theta_goal: float) -> BangBang:
        """Minimum time from rest to rest upwards under the true dynamics, by quadrature of the energy.

        Pushed up by τ_max, then braked: ½ J θ̇² is τ_max (θ - θ_0) - G (sin θ - sin θ_0) before and
        τ_max (θ_f - θ) + G (sin θ_f - sin θ) after θ_s, where both agree.

        Args:
            theta_start: [rad].
            theta_goal: above it [rad].

        Raises:
            ProblemError: τ_max does not carry the link all the way up: it would have to swing.
        """
        tau, G, J = self.torque_limit, self.gravity, self.inertia
        middle = (theta_start + theta_goal) / 2
        switch = middle + G / (2 * tau) * (np.sin(theta_goal) - np.sin(theta_start))
        if tau <= G or not theta_start < switch < theta_goal:
            raise ProblemError(f"{tau} N m do not push a link of {G:.4g} N m straight to {theta_goal:.4g} rad")

        def pushed(s: float) -> float:  # θ = θ_0 + s²: the speed vanishes like s
            theta = theta_start + s**2
            energy = tau * s**2 - G * (np.sin(theta) - np.sin(theta_start))
            return float(2 * s / np.sqrt(2 * energy / J))

        def braked(s: float) -> float:
            theta = theta_goal - s**2
            energy = tau * s**2 + G * (np.sin(theta_goal) - np.sin(theta))
            return float(2 * s / np.sqrt(2 * energy / J))

        up = quad(pushed, 0, np.sqrt(switch - theta_start), epsabs=1e-13, epsrel=1e-13)[0]
        down = quad(braked, 0, np.sqrt(theta_goal - switch), epsabs=1e-13, epsrel=1e-13)[0]
        return BangBang((float(up),), (1, -1), float(up + down))

    def trajectory(self, law: BangBang, samples: int = 201) -> Trajectory:
        """The linearised motion of a bang-bang law from rest at -π/2.

        Args:
            law: its torque.
            samples: of each arc, both ends included.
        """
        x = np.array([THETA_START, 0.0])
        t, states, torques = [], [], []
        starts, ends = (0.0, *law.switches), (*law.switches, law.duration)
        for start, end, sign in zip(starts, ends, law.signs, strict=True):
            tau = sign * self.torque_limit
            # A jump is two samples one ulp apart: the rule of `Trajectory`.
            times = np.linspace(start if start == 0 else np.nextafter(start, np.inf), end, samples)
            t.append(times)
            states.append([self.flow(x, tau, time - start) for time in times])
            torques.append(np.full((samples, 1), tau))
            x = self.flow(x, tau, end - start)
        state = np.concatenate(states)
        return Trajectory(np.concatenate(t), state[:, :1], state[:, 1:], np.concatenate(torques), ("joint1",), "linear")


@dataclass(frozen=True)
class PrintedLaw:
    """The printed law in place of `OneLink`'s law: (14), (15) and the matrix before them.

    Attributes:
        r: of (11) [1/s²], negative.
        k: of (11) [1/(kg m²)].
    """

    r: float
    k: float

    def transition(self, t: float) -> Array:
        """The matrix that is printed as exp(tM), shape (2, 2): r stands where ω = √|r| belongs.

        Args:
            t: [s].
        """
        c, s = np.cos(self.r * t), np.sin(self.r * t)
        return np.array([[c, s], [self.r * s, c]])

    def determinant(self, t: float) -> float:
        """The printed matrix's, det = cos²(rt) - r sin²(rt). That of exp(tM) is 1, as tr M = 0."""
        return float(np.linalg.det(self.transition(t)))

    @property
    def interval(self) -> float:
        """2π/|r|, called the time between switches [s]; its unit is s²."""
        return 2 * np.pi / abs(self.r)

    def amplitude(self, t: float) -> float:
        """k/det, called the torque [N m]; its unit is 1/(kg m²), and it varies with t [s]."""
        return self.k / self.determinant(t)


def printed_law(link: OneLink) -> PrintedLaw:
    """The printed variant for a link."""
    return PrintedLaw(link.r, link.k)


@dataclass(frozen=True)
class Linearisation:
    """Error of the first approach with one payload.

    Attributes:
        payload: M [kg].
        reading: where the payload is.
        linearised: the law of the linearised link.
        exact: the law of the link itself.
        miss: distance from the goal at which the linearised law's torque leaves the link itself [rad, rad/s].
    """

    payload: float
    reading: Reading
    linearised: BangBang
    exact: BangBang
    miss: tuple[float, float]


def linearisation(payload: float, reading: Reading = "tip") -> Linearisation:
    """Example 1 by the first approach, against its true minimum time.

    Args:
        payload: M [kg].
        reading: where the payload is.
    """
    case = Case(1, "r", "minimum_time", payload, reading)
    (start,), (goal,) = case.q_start, case.q_goal
    link = OneLink.of(payload, reading)
    law = link.linearised_minimum_time(goal)
    end = replay_torques(case.robot(), link.trajectory(law, samples=2))
    miss = float(end.q[-1, 0] - goal), float(end.v[-1, 0])
    return Linearisation(payload, reading, law, link.minimum_time(start, goal), miss)


@cache
def all_linearisations() -> tuple[Linearisation, ...]:
    """Linearisations with every payload of Table 2, in both readings."""
    return tuple(linearisation(payload, reading) for reading in READINGS for payload in PAYLOADS)
