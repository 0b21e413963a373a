"""Trust-region step: minimum of a quadratic model within a ball and half-spaces, by an active-set method."""

import math
from dataclasses import dataclass

import numpy as np
from scipy.optimize import nnls

from armdyn.arrays import Array

RANK = 1e-10
"""Relative tolerance of singular values: rounding."""
TIGHT = 1e-8
"""Distance to a plane that counts as zero, in units of the unknowns: landing converges to about a tenth of it."""
_ALONG = 1e-12
"""Approach to a plane, as a part of the radius, up to which a step is parallel to the plane."""
_NEGATIVE_MULTIPLIER = 1e-9
"""Multiplier of a plane that counts as zero, relative to time's 1."""
_CHANGES = 4
"""Largest number of active-set changes, per unknown: more are a cycle."""


@dataclass(frozen=True, eq=False)
class QuadraticForm:
    """The objective gradient·y + yᵀ Hessian y / 2.

    Attributes:
        gradient: gradient at 0, shape (k,).
        hessian: symmetric Hessian, shape (k, k).
    """

    gradient: Array
    hessian: Array

    def at(self, y: Array) -> float:
        """Value of the form at y; 0 at 0."""
        return float(self.gradient @ y + y @ self.hessian @ y / 2)

    def within(self, rows: Array, slack: Array, radius: float) -> tuple[Array, bool]:
        """Minimise the form in |y| ≤ radius with rows y + slack ≥ 0; return y and whether the radius is active.

        From y = 0 the method goes to the minimum on the active planes, or to the next plane, which becomes active; at
        the minimum, planes with a negative multiplier become inactive.

        Args:
            rows: normals of the planes, shape (planes, k).
            slack: slack at y = 0, shape (planes,); negative counts as zero.
            radius: radius of the ball.
        """
        y, slack, kept = np.zeros_like(self.gradient), np.maximum(slack, 0.0), list[int]()
        best, best_value, rim_there = y, 0.0, False
        for _ in range(_CHANGES * self.gradient.size):
            target, shift, rim = self._along(y, rows[kept], radius)
            by = rows @ (target - y)
            left = np.maximum(slack + rows @ y, 0.0)
            nearer = by < -_ALONG * radius
            nearer[kept] = False
            shares = np.where(nearer, left / np.where(nearer, -by, 1.0), np.inf)
            k = int(np.argmin(shares)) if shares.size else -1
            whole = k < 0 or shares[k] >= 1
            y = target if whole else y + shares[k] * (target - y)
            if self.at(y) < best_value:
                best, best_value, rim_there = y, self.at(y), rim and whole
            if not whole:
                kept.append(k)
                continue
            if not kept:
                break
            multiplier = np.linalg.lstsq(rows[kept].T, self.gradient + self.hessian @ y + shift * y, rcond=RANK)[0]
            if np.min(multiplier) >= -_NEGATIVE_MULTIPLIER:
                break
            kept.pop(int(np.argmin(multiplier)))
        return best, rim_there

    def _along(self, y: Array, kept: Array, radius: float) -> tuple[Array, float, bool]:
        """Minimum in the ball at y's distance from some planes; the ball's multiplier; whether the ball is active."""
        free = null_space(kept) if len(kept) else np.eye(y.size)
        if not len(free):
            return y, 0.0, False
        base: Array = y - (free @ y) @ free
        values, axes = np.linalg.eigh(free @ self.hessian @ free.T)
        down: Array = -axes.T @ (free @ (self.gradient + self.hessian @ base))
        own, shift, rim = _in_ball(values, down, math.sqrt(max(radius**2 - float(base @ base), 1e-30)))
        return base + (axes @ own) @ free, shift, rim


def held_back(gradient: Array, rows: Array) -> tuple[Array, float]:
    """Multipliers of the planes that block a descent, shape (planes,), and the norm of the projected gradient.

    Args:
        gradient: gradient, shape (k,).
        rows: normals of the planes, shape (planes, k).
    """
    if not len(rows):
        return np.empty(0), float(np.linalg.norm(gradient))
    multiplier, left = nnls(rows.T, gradient)
    return np.asarray(multiplier), float(left)


def null_space(rows: Array) -> Array:
    """Orthonormal basis of the null space of rows, shape (k, columns)."""
    values, directions = np.linalg.svd(rows)[1:]
    return np.asarray(directions[int(np.sum(values > RANK * values[0])) :])


def _in_ball(values: Array, down: Array, radius: float) -> tuple[Array, float, bool]:
    """Minimum of ½ Σ λ y² − down·y within a ball, its multiplier, and whether the ball is active.

    Moré and Sorensen, Computing a trust region step, SIAM J. Sci. Stat. Comput. 4, 1983.
    """
    low = max(0.0, -float(values[0]) * (1 + 1e-9) + 1e-12) if values[0] <= 0 else 0.0
    y: Array = down / (values + low)
    if np.linalg.norm(y) <= radius:
        return y, low, False
    high = low + float(np.linalg.norm(down)) / radius + float(np.max(np.abs(values)))
    for _ in range(60):
        shift = (low + high) / 2
        y = down / (values + shift)
        low, high = (shift, high) if np.linalg.norm(y) > radius else (low, shift)
    return down / (values + high), high, True
