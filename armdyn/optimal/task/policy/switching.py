"""Tuned numbers of switching structures: their rollouts, descent, contacts and singular arcs."""

from dataclasses import dataclass
from typing import ClassVar

from armdyn.optimal.task.policy.tuned import PLANAR, UNRECORDED, tuned

PAIRS = "RRR, random pairs (seed 1, poses within ±π)"


@dataclass(frozen=True, kw_only=True)
class RolloutPolicy:
    """Tuned numbers of rollouts: steps of the arcs, tolerances of limits and contacts."""

    cases: ClassVar = PAIRS

    per_free_arc: int = tuned(
        24, "steps", "of an arc on which a torque is free: two per coefficient of the longest singular control"
    )
    per_arc: int = tuned(3, "steps", "of an arc, in the mean: with fewer, excesses between them are missed")
    finest: int = tuned(4, "times the fewest steps", "of a rollout, at most")
    time_scale: float = tuned(
        0.2, "of the duration", "shift of a bang arc that weighs as much as the whole range of a free torque"
    )
    beyond: float = tuned(
        1e-6, "rad or m, or of a velocity limit", "largest excess of a limit that is accepted", PLANAR
    )
    touch: float = tuned(1e-7, "of the duration", "a shorter arc on a velocity limit is a touch", UNRECORDED)
    per_interval: int = tuned(
        3, "steps", "of an interval of the certificate at constant torques; one where a torque is free", PLANAR
    )

    def groups(self, steps: int) -> int:
        """Number of the certificate's intervals in an arc of constant torques with a given number of steps."""
        return max(1, round(steps / self.per_interval))


@dataclass(frozen=True, kw_only=True)
class DescentPolicy:
    """Tuned numbers of the optimisation of switching times: Newton's method and descent."""

    cases: ClassVar = PAIRS

    rounds: int = tuned(30, "rounds", "of Newton's method from a mesh's states: a heavy arm with singular arcs")
    near_rounds: int = tuned(4, "rounds", "of Newton's method from a motion next to the structure")
    closed: float = tuned(1e-9, "of a radian and of the largest speed", "gaps at the integrator's error", PLANAR)
    far: float = tuned(0.5, "of the duration", "correction of a time beyond which no solution is near")
    time_step: float = tuned(0.1, "of the duration", "largest correction of a time in one round")
    states: float = tuned(0.1, "-", "weight of a state's correction relative to a time's")
    state_step: float = tuned(0.3, "of a radian and of the largest speed", "largest correction of a state in one round")
    kept: float = tuned(0.2, "of a segment", "least part that one correction leaves")
    cubic: float = tuned(
        1.5e-4, "integrator steps", "cost of a correction, divided by the cube of its unknowns", "random arms (RRR)"
    )
    budget_excess: float = tuned(
        3_000, "integrator steps", "beyond the budget, at which Newton's method ends, too", "random arms (RRR)"
    )
    steps: int = tuned(20, "steps", "along tangents: those that reached an extremal took 13 at most")
    radius: float = tuned(0.03, "of the duration", "first radius of the trust region")
    narrow: float = tuned(1e-6, "of the duration", "radius below which the descent ends")
    flat: float = tuned(1e-6, "-", "∂t_f/∂(switching time) that counts as zero: 1/100 of the certificate's")
    nearly_flat: float = tuned(1e-4, "-", "the same where the model predicts no gain: the certificate's tolerance")
    worth: float = tuned(1e-12, "of the duration", "least predicted gain of a step")
    difference: float = tuned(
        1e-7, "of the duration", "step of differences for second derivatives: balances rounding and truncation"
    )
    short: float = tuned(
        1e-2, "of the duration", "shorter segments may vanish in one step; longer ones shrink by a tenth first"
    )
    vanished: float = tuned(1e-8, "of the duration", "a shorter segment is removed")
    halves: int = tuned(12, "halvings", "of a step that exceeds a position limit")
    near: float = tuned(1e-3, "rad or m", "excess of a position limit at which a touch is inserted")
    far_beyond: float = tuned(0.3, "rad or m", "the same at most, of the first motion that lands")
    touch_cost: float = tuned(0.05, "of the duration", "largest cost of touches of position limits")
    arc_cost: float = tuned(
        0.5, "of the duration", "largest cost of arcs on velocity limits, which were exceeded for long"
    )
    touches: int = tuned(3, "times", "that touches are inserted: one may cause another")


@dataclass(frozen=True, kw_only=True)
class ContactPolicy:
    """Tuned numbers of the correction of contacts with limits of position and velocity."""

    cases: ClassVar = PAIRS

    excess: float = tuned(1e-6, "of half a torque's range", "excess of a torque limit that a contact may need")
    inward: float = tuned(
        5e-5, "of the largest multiplier", "negative multiplier that shortens a contact: half the certificate's"
    )
    whole: float = tuned(0.02, "of a contact", "remainder at an end that is no contact of its own")
    least: float = tuned(0.1, "of a contact", "least first shortening")
    end: float = tuned(0.25, "of a contact", "a negative multiplier so near an end shortens that end")


@dataclass(frozen=True, kw_only=True)
class SingularPolicy:
    """Tuned numbers of singular controls: their insertion and initial guess."""

    cases: ClassVar = PAIRS

    apart: float = tuned(0.05, "of the duration", "stretches of one joint at less distance are merged")
    few: int = tuned(3, "coefficients", "of a singular control that are fitted to the torque before")
    many: int = tuned(15, "coefficients", "of a singular control, at most", PAIRS + "; random arms (RR, seed 1)")
    added: int = tuned(2, "coefficients", "that are added at a time, while the switching function is not zero")
    inside: float = tuned(0.95, "of the way to a limit", "largest initial value of a singular control")
    on_limit: float = tuned(0.9, "of the way to a limit", "from which a torque of a mesh counts as on the limit")
    reached: float = tuned(1e-4, "of a torque's range", "distance at which a free torque has reached its limit")
    rise: float = tuned(0.2, "of the rise of H that justifies a bang arc", "at which that arc begins and ends")
    short: float = tuned(0.05, "of a segment", "a shorter singular control is replaced by the bang arc next to it")
    samples: int = tuned(200, "samples", "of a segment, for the fit of a singular control")
    long: float = tuned(0.05, "of the duration", "a shorter stretch of a mesh off all limits is read as bang arcs")
    first: float = tuned(1e-3, "of the duration", "bang arc at the start, before the first singular control")
    in_arc: int = tuned(50, "samples", "of a mesh's torque in an arc, for the mean")
    along: int = tuned(100, "samples", "of a mesh's torques along a stretch")


@dataclass(frozen=True, kw_only=True)
class SwitchingPolicy:
    """Tuned numbers of the correction of switching structures by Pontryagin's conditions."""

    cases: ClassVar = PAIRS

    rounds: int = tuned(40, "rounds", "a contact that ends in shorter and shorter bounces takes two for each")
    least: float = tuned(
        5e-5, "-", "decrease of H that justifies a bang arc or a longer control: half of the certificate's tolerance"
    )
    worse: float = tuned(0.05, "of the worst decrease of H", "stretches below are left to later rounds")
    drift: float = tuned(1e-5, "-", "change of H along an arc at which steps are too long: a tenth of certified")
    drift_unsolved: float = tuned(1e-3, "-", "the same if no extremal was found, perhaps because of long steps")
    shorter: float = tuned(1e-11, "of the duration", "least gain of a corrected contact")
    trial: float = tuned(1 / 3, "of the budget left", "for a structure while others wait; good ones take a tenth")
    patience: int = tuned(3, "rounds", "in a row without an improvement")
    better: float = tuned(0.7, "of the least worst sign so far", "an improvement")
