"""The benchmarks of underactuated control by hand: equations of motion, and bang-bang motions of a known structure."""

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import root

G = 9.81


def cart_pole(q, v, force):
    """Accelerations of a cart of 1 kg with 0.3 kg on a massless pole of 0.5 m, by Lagrange."""
    cart, point, length = 1.0, 0.3, 0.5
    s, c = np.sin(q[1]), np.cos(q[1])
    inertia = np.array([[cart + point, point * length * c], [point * length * c, point * length**2]])
    rest = np.array([-point * length * s * v[1] ** 2, point * G * length * s])
    return np.linalg.solve(inertia, [force, 0.0] - rest)


def double_pendulum(links, motor):
    """Accelerations of two hanging links of which one joint has a motor: (q, v, torque) ↦ a.

    Spong, The swing up control problem for the acrobot (1995), with angles from hanging down.

    Args:
        links: mass [kg], length [m], centre of mass [m] and inertia about it [kg m²] of each.
        motor: the joint that has it.
    """
    (m1, l1, c1, i1), (m2, _, c2, i2) = links

    def accelerations(q, v, torque):
        s, c = np.sin(q[1]), np.cos(q[1])
        d22 = m2 * c2**2 + i2
        d12 = d22 + m2 * l1 * c2 * c
        d11 = m1 * c1**2 + i1 + m2 * l1**2 + d22 + 2 * m2 * l1 * c2 * c
        h = m2 * l1 * c2 * s * np.array([-v[1] * (2 * v[0] + v[1]), v[0] ** 2])
        second = m2 * c2 * G * np.sin(q[0] + q[1])
        gravity = np.array([(m1 * c1 + m2 * l1) * G * np.sin(q[0]) + second, second])
        return np.linalg.solve([[d11, d12], [d12, d22]], torque * np.eye(2)[motor] - h - gravity)

    return accelerations


acrobot = double_pendulum([(1.0, 1.0, 0.5, 0.083), (1.0, 2.0, 1.0, 0.33)], motor=1)

_FIRST, _SECOND = 0.5234602302310271, 0.6255677234174437  # [kg]
_CENTRE = 0.25569305436052964  # [m]
pendubot = double_pendulum(
    [
        (_FIRST, 0.2, 0.2, 0.031887199591513114 - _FIRST * 0.2**2),
        (_SECOND, 0.3, _CENTRE, 0.05086984812807257 - _SECOND * _CENTRE**2),
    ],
    motor=0,
)
"""As identified for its inertias about the joints."""


def furuta_pendulum(q, v, torque):
    """Accelerations of an arm of 95 g and 85 mm about the vertical with a thin rod of 24 g and 129 mm, by Lagrange."""
    arm, reach, rod, half = 0.095, 0.085, 0.024, 0.0645
    turning = 2e-6 + 5.72e-5 + arm * (reach / 2) ** 2 + rod * reach**2
    swinging = 3.3282e-5 + rod * half**2
    s, c = np.sin(q[1]), np.cos(q[1])
    coupling = rod * reach * half
    inertia = np.array([[turning + swinging * s**2, coupling * c], [coupling * c, swinging]])
    rest = np.array(
        [
            2 * swinging * s * c * v[0] * v[1] - coupling * s * v[1] ** 2,
            -swinging * s * c * v[0] ** 2 + rod * G * half * s,
        ]
    )
    return np.linalg.solve(inertia, [torque, 0.0] - rest)


BY_HAND = {"acrobot": acrobot, "cart_pole": cart_pole, "furuta_pendulum": furuta_pendulum, "pendubot": pendubot}


def reached(accelerations, durations, torques, start):
    """The state (q, v) that torques, one after the other for these durations [s], lead to, shape (4,)."""
    x = np.concatenate([start, np.zeros(2)])
    for duration, torque in zip(durations, torques, strict=True):
        run = solve_ivp(
            lambda _, y, u=torque: np.concatenate([y[2:], accelerations(y[:2], y[2:], u)]),
            (0, duration), x, "DOP853", rtol=1e-11, atol=1e-12,
        )  # fmt: skip
        x = run.y[:, -1]
    return x


def bang_bang_duration(accelerations, durations, torques, start, goal):
    """How long four arcs take from rest to rest [s]: their durations solve four equations, by MINPACK."""
    target = np.concatenate([goal, np.zeros(2)])
    found = root(lambda d: reached(accelerations, np.abs(d), torques, start) - target, durations, tol=1e-12)
    assert found.success, found.message
    return float(np.sum(np.abs(found.x)))


def linear_side_move(distance, force):
    """The least time [s] of a cart-pole's move from rest to rest, for small angles.

    Its centre of mass is a double integrator, next to it an oscillator. Full force one way, the other, back and forth,
    antisymmetric in time, for a, b, b, a: Ben-Asher, Burns and Cliff, Time-optimal slewing of flexible spacecraft,
    Journal of Guidance, Control, and Dynamics 15(2), 1992. The remaining oscillation is
    1 − 2 cos ωb + cos ω(a + b), and the way is f (a² + 2ab − b²) with the acceleration f.

    Args:
        distance: [m].
        force: [N].
    """
    mass, frequency = 1.3, np.sqrt(G * 1.3 / 0.5)  # of cart and pole [kg]; of the pole on the free cart [rad/s]

    def wrong(durations):
        a, b = durations
        way = force / mass * (a**2 + 2 * a * b - b**2) / distance - 1
        return [way, 1 - 2 * np.cos(frequency * b) + np.cos(frequency * (a + b))]

    whole = np.sqrt(distance * mass / force)
    found = root(wrong, [0.7 * whole, 0.4 * whole], tol=1e-13)
    assert found.success and np.all(found.x > 0), found.message
    return 2 * float(np.sum(found.x))
