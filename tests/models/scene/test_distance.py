"""Distances of the program against coal's, their derivatives against differences."""

import casadi as ca
import coal
import numpy as np
import pinocchio as pin
import pytest
from armdyn.models.scene.distance import from_segment, least_over_segment

from armdyn.models.scene.obstacles import Box, Capsule, Sphere

OBSTACLES = (
    Sphere((0.1, 0.2, 0.3), 0.1),
    Capsule((0, 0.1, 0.2), (0.3, 0.2, 0.1), 0.05),
    Box((0.2, 0.3, 0.4), pin.SE3(pin.rpy.rpyToMatrix(0.3, 0.4, 0.5), np.array([0.1, 0.2, 0.3]))),
)


def of_coal(obstacle, a, b):
    """Signed distance of a segment from an obstacle [m]."""

    def capsule(a, b, radius):
        turned = pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), b - a).matrix()
        return coal.Capsule(radius, np.linalg.norm(b - a)), coal.Transform3s(turned, (a + b) / 2)

    if isinstance(obstacle, Sphere):
        other = coal.Sphere(obstacle.radius), coal.Transform3s(np.eye(3), np.array(obstacle.center))
    elif isinstance(obstacle, Capsule):
        other = capsule(np.array(obstacle.a), np.array(obstacle.b), obstacle.radius)
    else:
        other = coal.Box(*obstacle.size), coal.Transform3s(obstacle.pose[:3, :3], obstacle.pose[:3, 3])
    return coal.distance(*capsule(a, b, 1e-9), *other, coal.DistanceRequest(), coal.DistanceResult())


def functions(obstacle):
    x, scene = ca.SX.sym("x", 6), ca.SX.sym("scene", obstacle.count)
    body = obstacle.symbolic(scene)
    value = least_over_segment(body.distance, x[:3], x[3:]) - body.thickness
    hessian, gradient = ca.hessian(value, x)
    made = [ca.Function("f", [x, scene], [each]) for each in (value, gradient, hessian)]
    return [lambda at, f=f: np.array(f(at, obstacle.numbers())).squeeze() for f in made]


@pytest.mark.parametrize("obstacle", OBSTACLES, ids=lambda each: each.name)
def test_values_and_derivatives(obstacle):
    value, gradient, hessian = functions(obstacle)
    random, tested = np.random.default_rng(0), 0
    for _ in range(200):
        a = random.uniform(-1, 1, 3)
        x = np.concatenate([a, a + 0.3 * random.normal(size=3)])
        distance = of_coal(obstacle, x[:3], x[3:])
        if distance <= 0.02:  # overlaps are coal's penetration depths, and near zero roundings differ
            continue
        tested += 1
        # Rounded off by 1e-4 m, and never to the unsafe side; GJK stops at 1e-6.
        assert -1.1e-4 < value(x) - distance < 1e-6
        step = 1e-5
        slopes = [(value(x + step * e) - value(x - step * e)) / (2 * step) for e in np.eye(6)]
        np.testing.assert_allclose(gradient(x), slopes, atol=1e-6)  # differences of 1e-16 over 1e-5, and curvature
        bends = [(gradient(x + step * e) - gradient(x - step * e)) / (2 * step) for e in np.eye(6)]
        np.testing.assert_allclose(hessian(x), bends, atol=1e-4 * (1 + np.max(np.abs(bends))))
    assert tested > 100


@pytest.mark.parametrize("obstacle", OBSTACLES, ids=lambda each: each.name)
def test_overlaps_are_negative_and_finite(obstacle):
    value, gradient, hessian = functions(obstacle)
    centre = obstacle.pose[:3, 3] if isinstance(obstacle, Box) else np.array(obstacle.numbers()[:3])
    for x in (np.tile(centre, 2), np.concatenate([centre - 1, centre + 1]), np.concatenate([centre, centre + 1])):
        assert value(x) < 0
        assert np.all(np.isfinite(gradient(x))) and np.all(np.isfinite(hessian(x)))


def test_between_two_segments_even_parallel_ones():
    a, b = ca.SX.sym("a", 3), ca.SX.sym("b", 3)
    value = least_over_segment(from_segment(ca.SX([0, 0, 0]), ca.SX([1, 0, 0])), a, b)
    f = ca.Function("f", [a, b], [value, ca.jacobian(value, a)])
    for start, end, distance in (
        ([0.2, 0, 0.5], [0.8, 0, 0.5], 0.5),
        ([0.5, -1, 0.3], [0.5, 1, 0.3], 0.3),
        ([2, 0, 0], [3, 0, 0], 1.0),
        ([1.3, 0.4, 0], [1.3, 0.4, 2], 0.5),
    ):
        found, slope = f(start, end)
        assert float(found) == pytest.approx(distance, abs=1.1e-4)
        assert np.all(np.isfinite(np.array(slope)))
