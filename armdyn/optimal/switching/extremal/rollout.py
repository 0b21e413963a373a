"""Rollout: a switching structure integrated in steps, with its derivatives in the switching times."""

from dataclasses import dataclass, replace
from heapq import heapify, heapreplace
from typing import Self

import numpy as np

from armdyn.arrays import Array, Flags, Index
from armdyn.locks import cached_property
from armdyn.optimal.arcs.arc import POSITION, VELOCITY, Mode, outward
from armdyn.optimal.arcs.grid import Density, layered
from armdyn.optimal.problem.problem import MinimumTimeProblem
from armdyn.optimal.problem.status import Budget
from armdyn.optimal.switching.extremal.flow import STEPS, Flow
from armdyn.optimal.switching.extremal.step_torques import Torques
from armdyn.optimal.switching.extremal.structure import SwitchingStructure
from armdyn.optimal.task.policy import Policy
from armdyn.optimal.task.task import Task
from armdyn.trajectory import Trajectory


@dataclass(frozen=True, eq=False)
class ShootingProblem:
    """Shooting problem: dynamics, limits and end state.

    Attributes:
        problem: problem with limits, start and goal.
        policy: tuned numbers.
        flow: flow of the arm.
        body: dynamic parameters of the last body, shape (10,).
        torque_unit: torque of a coefficient of 1 in a singular control [N m], shape (nv,): weighs as much as a shift of
            a change by a second.
        budget: stopping condition, and budget of integrator steps.
        offset: offset of the end state from the goal, (q, v), shape (2 nv,).
        steps: number of steps of a rollout.
        layers: density of steps in layers of dry friction; None: no such layers.
    """

    problem: MinimumTimeProblem
    policy: Policy
    flow: Flow
    body: Array
    torque_unit: Array
    budget: Budget
    offset: Array | float = 0.0
    steps: int = STEPS
    layers: Density | None = None

    @property
    def most_arcs(self) -> int:
        """Largest number of arcs of a rollout."""
        return self.steps // self.policy.rollout.per_arc

    def finer(self, near: "Rollout | None" = None) -> Self | None:
        """The problem with twice the steps, placed for a nearby motion; None at the largest number of steps."""
        if self.steps >= self.policy.rollout.finest * STEPS:
            return None
        friction, numbers = self.problem.robot.friction, self.policy.arcs
        layers = self.layers if near is None else layered(near.motion, friction, numbers)
        return replace(self, steps=2 * self.steps, layers=layers)

    @classmethod
    def of(cls, task: Task, flow: Flow, motion: Trajectory) -> Self:
        """Make a task's shooting problem near a motion."""
        problem, policy = task.problem, task.policy
        unit = problem.limits.actuators.width / (policy.rollout.time_scale * motion.duration)
        layers = layered(motion, problem.robot.friction, policy.arcs)
        return cls(problem, policy, flow, task.dynamics.last_body, unit, Budget(task.stop), layers=layers)

    @property
    def end(self) -> Array:
        """End state (q, v), shape (2 nv,)."""
        return np.asarray(self.problem.x_goal + self.offset)


@dataclass(frozen=True, eq=False)
class Rollout:
    """Arcs of a structure, integrated in steps, each arc from its own initial state.

    Attributes:
        shooting: the shooting problem.
        structure: the arcs.
        arc: index of each step's arc, shape (steps,); no arc is empty.
        part: part of its arc that each step is, likewise.
        h: lengths of the steps [s], shape (steps,).
        start: states at the steps' starts, shape (steps, 2 nv).
        end: states at the steps' ends, likewise.
        state_transition: ∂end/∂start, shape (steps, 2 nv, 2 nv).
        rate: ẋ at the ends, shape (steps, 2 nv).
        torque_sensitivity: ∂end/∂τ of free torques at the steps' starts and ends, shape (steps, 2 nv, 2, nv).
        torques: torques of the steps.
    """

    shooting: ShootingProblem
    structure: SwitchingStructure
    arc: Index
    part: Array
    h: Array
    start: Array
    end: Array
    state_transition: Array
    rate: Array
    torque_sensitivity: Array
    torques: Torques

    @classmethod
    def of(
        cls,
        shooting: ShootingProblem,
        structure: SwitchingStructure,
        joined: Flags | None = None,
        steps: tuple[Index, Array] | None = None,
    ) -> Self:
        """Integrate a structure.

        Args:
            shooting: the shooting problem.
            structure: structure with at most `ShootingProblem.most_arcs` arcs.
            joined: whether a change's state is the end of the arc before, shape (m,); None: all have their own states.
            steps: index of each step's arc, and its part of that arc, shape (steps,); None: in proportion to lengths.
        """
        lengths = np.diff(np.concatenate([[0.0], structure.times, [structure.duration]]))
        curved = np.array([Mode.FREE in modes for modes in structure.modes()])
        arc, part = _steps_of_arcs(shooting, lengths, curved) if steps is None else steps
        h = lengths[arc] * part
        torques = Torques.of(shooting.problem.limits, shooting.torque_unit, structure, arc, part)
        begins = np.concatenate([[True], arc[1:] != arc[:-1]])
        later = np.flatnonzero(begins)[1:]  # first steps of the arcs after changes
        states = np.vstack([shooting.problem.x_start, structure.states])
        own = np.where(begins[:, None], states[arc], 0.0)
        if joined is not None:
            begins[later[joined]] = False
        body = np.tile(shooting.body, (arc.size, 1))
        columns = own, begins.astype(float), h, *torques.tau
        shooting.budget.spend(arc.size * len(torques.layers))
        torque_sensitivity = np.zeros((arc.size, own.shape[1], 2, torques.free_mask.shape[1]))
        for free_mask in torques.layers:
            end, state_transition, along, rate = shooting.flow.rolled_out(*columns, free_mask, torques.held, body)
            with np.errstate(invalid="ignore"):  # diverging motions: see `finite`
                torque_sensitivity += along[:, :, :, None] * free_mask[:, None, None]
        start = np.where(begins[:, None], own, np.vstack([states[:1], end[:-1]]))
        structure = replace(structure, states=start[later])
        return cls(shooting, structure, arc, part, h, start, end, state_transition, rate, torque_sensitivity, torques)

    @property
    def finite(self) -> bool:
        """Whether all numbers are finite."""
        return bool(np.all(np.isfinite(self.end)) and np.all(np.isfinite(self.state_transition)))

    @cached_property
    def last(self) -> Index:
        """The last step of every arc, shape (m + 1,)."""
        return np.append(np.flatnonzero(np.diff(self.arc)), self.arc.size - 1)

    @cached_property
    def times(self) -> Array:
        """Times at the steps' ends, from the start on [s], shape (steps + 1,)."""
        return np.concatenate([[0.0], np.cumsum(self.h)])

    @property
    def motion(self) -> Trajectory:
        """Motion through the states at the steps' ends."""
        n, lasting = self.shooting.problem.robot.nv, np.append(True, np.diff(self.times) > 0)  # without rounding
        x, tau = np.vstack([self.start[:1], self.end])[lasting], self.torques.tau
        return Trajectory(self.times[lasting], x[:, :n], x[:, n:], np.vstack([tau[0][:1], tau[1]])[lasting])

    @cached_property
    def held_states(self) -> list[tuple[int, int, float]]:
        """Conditions of active state limits: index of the change, index in (q, v), and the value there."""
        n, limits = self.shooting.problem.robot.nv, self.shooting.problem.limits
        out: list[tuple[int, int, float]] = []
        modes = self.structure.modes()
        for k, change in enumerate(self.structure.changes):
            i, mode = change.joint, change.mode
            if mode is modes[k][i] and mode in POSITION:
                continue  # already satisfied
            if mode in POSITION:
                bound = limits.position_upper if mode is Mode.POSITION_UPPER else limits.position_lower
                out += [(k, i, float(bound[i])), (k, n + i, 0.0)]
            elif mode in VELOCITY:
                out.append((k, n + i, outward(mode) * float(limits.velocity[i])))
        return out

    @cached_property
    def unit(self) -> Array:
        """Scales of (q, v): a radian, and the largest speed, shape (2 nv,)."""
        n = self.shooting.problem.robot.nv
        return np.repeat([1.0, max(1e-3, float(np.max(np.abs(self.end[:, n:]))))], n)

    def switching(self, costates: tuple[Array, Array]) -> Array:
        """Switching functions at the starts and ends of all steps, shape (2 steps, nv).

        Args:
            costates: costates p at starts and ends, each of shape (steps, 2 nv).
        """
        n, held = self.shooting.problem.robot.nv, np.tile(self.torques.held, (2, 1))
        body = np.tile(self.shooting.body, (len(held), 1))
        q = np.vstack([self.start, self.end])[:, :n]
        return self.shooting.flow.switchings(q, np.vstack(costates), held, body)

    @cached_property
    def arcs(self) -> tuple[Array, Array]:
        """∂end/∂start of the arcs, shape (m + 1, 2 nv, 2 nv), and ∂end/∂(unknowns), shape (m + 1, 2 nv, width)."""
        arcs = np.arange(self.structure.size + 1)
        first, to_end = np.append(0, self.last[:-1] + 1), self._transition_to_end
        by = np.zeros((arcs.size, self.start.shape[1], self.structure.width))
        by[arcs, :, arcs] = self.rate[self.last]  # constant torques: a longer arc continues with its final rate
        by[arcs[1:], :, arcs[:-1]] = -self.rate[self.last[1:]]
        curved = np.any(self.torques.free_mask[first] > 0, axis=1)
        if np.any(curved):
            own = np.flatnonzero(curved[self.arc])
            starts = np.searchsorted(own, first[curved])
            by[curved] = np.add.reduceat(to_end[own] @ self._curved(own), starts)
        return to_end[first] @ self.state_transition[first], by

    @cached_property
    def _transition_to_end(self) -> Array:
        """∂(end of a step's arc)/∂(end of the step), shape (steps, 2 nv, 2 nv)."""
        to_end = np.empty_like(self.state_transition)
        to_end[self.last] = np.eye(self.start.shape[1])
        for k in range(self.arc.size - 2, -1, -1):
            if self.arc[k] == self.arc[k + 1]:
                np.matmul(to_end[k + 1], self.state_transition[k + 1], out=to_end[k])
        return to_end

    def _curved(self, own: Index) -> Array:
        """∂(end of a step)/∂(unknowns) from the step's own start, with a free torque, shape (steps, 2 nv, width).

        Args:
            own: indices of such steps.
        """
        torques, arc, h = self.torques, self.arc[own], self.h[own, None]
        before, after = self.torque_sensitivity[own, :, 0], self.torque_sensitivity[own, :, 1]
        rise = (torques.tau[1][own] - torques.tau[0][own]) / np.where(h, h, np.inf)
        stretched = (self.rate[own] - (after @ rise[..., None])[..., 0]) * self.part[own, None]
        by = before @ torques.by[0][own] + after @ torques.by[1][own]
        steps = np.arange(own.size)
        by[steps, :, arc] += stretched
        later = arc > 0
        by[steps[later], :, arc[later] - 1] -= stretched[later]
        return np.asarray(by)

    @cached_property
    def slack(self) -> tuple[Array, Array]:
        """Distances of free torques from both limits [`torque_unit`]; derivatives in the unknowns, (rows, width)."""
        return self.torques.slack(self.shooting.problem.limits, self.shooting.torque_unit)

    def perturbed(self, by: Array, states: Array) -> Self:
        """Integrate with other unknowns and states, in the same arcs and steps.

        Args:
            by: step of the unknowns, shape (width,).
            states: step of the changes' states, shape (m, 2 nv).
        """
        there = self.structure.moved(by, self.structure.states + states, in_order=False)
        return type(self).of(self.shooting, there, steps=(self.arc, self.part))


def _steps_of_arcs(shooting: ShootingProblem, lengths: Array, curved: Flags) -> tuple[Index, Array]:
    """Distribute steps over arcs: arc of each step, and its place in that arc from 0 to 1.

    Each arc has some, more with a free torque, most the longest one. Twice as many steps are used if curved arcs would
    take more than half of them. In layers of friction steps are placed by density, in groups of equal steps as the
    certificate merges them.
    """
    numbers, steps, layers = shooting.policy.rollout, shooting.steps, shooting.layers
    steps *= 2 if 2 * numbers.per_free_arc * curved.sum() > steps else 1
    own = max(2, min(numbers.per_free_arc, (steps - 2 * lengths.size) // max(int(curved.sum()), 1)))
    counts, mass = np.where(curved, own, 2), np.maximum(lengths, 0.0)
    if layers is not None:
        ends = np.concatenate([[0.0], np.cumsum(mass)])
        layers = replace(layers, t=layers.t * (ends[-1] / layers.t[-1]))
        mass = np.diff(layers.up_to(ends))
    longest = [(-part, k) for k, part in enumerate((mass / counts).tolist())]  # heap by length
    heapify(longest)
    for _ in range(steps - counts.sum()):
        top = longest[0][1]
        counts[top] += 1
        heapreplace(longest, (-float(mass[top] / counts[top]), top))
    arc = np.repeat(np.arange(lengths.size), counts)
    part = 1 / counts[arc]
    if layers is not None:
        for k in np.flatnonzero(~curved & (lengths > 0)):
            sizes = [group.size for group in np.array_split(np.arange(counts[k]), numbers.groups(counts[k]))]
            part[arc == k] = np.repeat(layers.between(ends[k], ends[k + 1], len(sizes)) / sizes, sizes)
    return arc, part
