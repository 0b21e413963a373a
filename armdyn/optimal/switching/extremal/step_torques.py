"""Torques of a rollout at the ends of its steps, with the free torques' derivatives in the unknowns."""

from dataclasses import dataclass
from typing import Self

import numpy as np

from armdyn.arrays import Array, Index
from armdyn.models.values.joint_limits import JointLimits
from armdyn.optimal.arcs.arc import POSITION, VELOCITY, Mode, bang_signs
from armdyn.optimal.switching.extremal.structure import SwitchingStructure


@dataclass(frozen=True, eq=False)
class Torques:
    """Torques at both ends of all steps, and derivatives of the free ones in the unknowns.

    Attributes:
        tau: torques at the starts and ends [N m], each of shape (steps, nv).
        held: 1 for joints held on a limit of position or velocity, shape (steps, nv).
        free_mask: 1 for joints whose torques are free, likewise.
        by: ∂τ/∂(unknowns) of free torques at the starts and at the ends, each of shape (steps, nv, width).
    """

    tau: tuple[Array, Array]
    held: Array
    free_mask: Array
    by: tuple[Array, Array]

    @classmethod
    def of(cls, limits: JointLimits, unit: Array, structure: SwitchingStructure, arc: Index, part: Array) -> Self:
        """Evaluate the torques of a structure's steps.

        Args:
            limits: torque limits.
            unit: torque of a coefficient of 1 in a singular control [N m], shape (nv,).
            structure: the structure.
            arc: index of each step's arc, shape (steps,).
            part: part of its arc that each step is, likewise.
        """
        modes = np.array(structure.modes())[arc]
        signs, free, held = bang_signs(modes), modes == Mode.FREE, np.isin(modes, (*POSITION, *VELOCITY))
        bang = limits.actuators.extreme(signs)
        tau = bang.copy(), bang.copy()
        by = tuple(np.zeros((*bang.shape, structure.width)) for _ in tau)
        places = structure.places
        for k, control in structure.controls.items():
            joint = structure.changes[k].joint
            end = structure.end_of(k)
            own = np.flatnonzero((arc > k) & (arc <= end))
            s, by_s = _along(structure, arc, part, own, (k, end))
            terms, derivatives = control.terms(s, np.concatenate([signs[own], signs[own]]))
            torque, by_coefficients = unit[joint] * (terms @ control.values), unit[joint] * terms
            by_unknowns = unit[joint] * (derivatives @ control.values)[:, None] * by_s
            by_unknowns[:, places[k]] += by_coefficients
            for side, half in enumerate((slice(own.size), slice(own.size, None))):
                tau[side][own, joint], by[side][own, joint] = torque[half], by_unknowns[half]
        return cls(tau, held.astype(float), free.astype(float), (by[0], by[1]))

    @property
    def layers(self) -> list[Array]:
        """Masks of free torques, at most one joint per step in each, shape (steps, nv); at least one mask."""
        number = np.cumsum(self.free_mask, axis=1)
        return [self.free_mask * (number == k + 1) for k in range(max(1, int(np.max(number))))]

    def slack(self, limits: JointLimits, unit: Array) -> tuple[Array, Array]:
        """Distances of free torques from both limits, and derivatives in the unknowns, shape (rows, width).

        Args:
            limits: torque limits.
            unit: unit of torques [N m], shape (nv,).
        """
        steps, joints = np.nonzero(self.free_mask)
        scale, values, rows = unit[joints], [np.empty(0)], [np.empty((0, self.by[0].shape[2]))]
        for tau, by in zip(self.tau, self.by, strict=True):
            for sign, bound in ((-1.0, limits.actuators.upper), (1.0, -limits.actuators.lower)):
                values.append((bound[joints] + sign * tau[steps, joints]) / scale)
                rows.append(sign * by[steps, joints] / scale[:, None])
        return np.concatenate(values), np.concatenate(rows)


def _along(
    structure: SwitchingStructure, arc: Index, lengths: Array, own: Index, ends: tuple[int, int]
) -> tuple[Array, Array]:
    """Places of steps' starts, then ends, in a segment, from 0 to 1; derivatives in the unknowns, (2 own, width).

    Args:
        structure: the structure.
        arc: index of each step's arc.
        lengths: lengths of the steps as parts of their arcs.
        own: indices of the steps.
        ends: changes at the start and the end of the segment.
    """
    edges = np.concatenate([[0.0], structure.times, [structure.duration]])
    by_edges = np.zeros((edges.size, structure.width))
    by_edges[1:, : edges.size - 1] = np.eye(edges.size - 1)
    before, last = np.tile(arc[own], 2), np.cumsum(lengths)[own] - arc[own]  # the parts of an arc sum up to 1
    part = np.concatenate([last - lengths[own], last])
    t = (1 - part) * edges[before] + part * edges[before + 1]
    by_t = (1 - part)[:, None] * by_edges[before] + part[:, None] * by_edges[before + 1]
    (begin, end), (by_begin, by_end) = edges[np.array(ends) + 1], by_edges[np.array(ends) + 1]
    length = max(end - begin, 1e-12)
    s = (t - begin) / length
    return s, (by_t - by_begin - s[:, None] * (by_end - by_begin)) / length
