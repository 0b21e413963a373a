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
        24, "steps", "of an arc on which a torque is free: two for a coefficient of the longest singular control"
    )
    per_arc: int = tuned(3, "steps", "of an arc, in the mean: fewer see nothing of what happens between")
    finest: int = tuned(4, "times the fewest steps", "of a rollout, at most")
    sway: float = tuned(
        0.2, "of the duration", "shift of a bang arc that counts as much as a free torque that goes through its range"
    )
    beyond: float = tuned(
        1e-6, "rad or m, or of a velocity limit", "largest excess of a limit that does not count as overlooked", PLANAR
    )
    met: float = tuned(1e-7, "of the duration", "a joint that is on a velocity limit for less touches it", UNRECORDED)
    together: int = tuned(
        3, "steps", "of an interval of the certificate where torques are constant; where one is free it is one", PLANAR
    )

    def groups(self, steps: int) -> int:
        """Number of the certificate's intervals in an arc of constant torques of so many steps."""
        return max(1, round(steps / self.together))


@dataclass(frozen=True, kw_only=True)
class DescentPolicy:
    """Tuned numbers of the optimisation of switching times: Newton's method, and descent."""

    cases: ClassVar = PAIRS

    rounds: int = tuned(30, "rounds", "of Newton's method from a mesh's states: a heavy arm with singular arcs")
    again: int = tuned(4, "rounds", "of Newton's method from a motion next to the structure")
    closed: float = tuned(1e-9, "of a radian and of the largest speed", "gaps that are the integrator's own", PLANAR)
    far: float = tuned(0.5, "of the duration", "correction of a time that says that no motion is near")
    stride: float = tuned(0.1, "of the duration", "largest correction of a time in one round")
    states: float = tuned(0.1, "-", "weight of a state's correction against that of a time")
    swing: float = tuned(0.3, "of a radian and of the largest speed", "largest correction of a state at once")
    kept: float = tuned(0.2, "of a segment", "that one correction leaves at least")
    cubic: float = tuned(
        1.5e-4, "integrator steps", "that a correction takes, times the cube of its unknowns", "random arms (RRR)"
    )
    overdrawn: float = tuned(
        20_000, "integrator steps", "beyond a budget at which Newton's method ends, too", "random arms (RRR)"
    )
    steps: int = tuned(20, "steps", "along tangents: those that came to an extremal took 13 at most")
    radius: float = tuned(0.03, "of the duration", "first radius of the trust region")
    narrow: float = tuned(1e-6, "of the duration", "radius below which the model is not to be trusted at all")
    flat: float = tuned(1e-6, "-", "∂t_f/∂(time of a change) that is none: a hundredth of the certificate's tolerance")
    nearly_flat: float = tuned(1e-4, "-", "the same where the model promises nothing any more: what is certified")
    worth: float = tuned(1e-12, "of the duration", "what a step must promise")
    difference: float = tuned(
        1e-7, "of the duration", "step of differences for second derivatives: between rounding and truncation"
    )
    short: float = tuned(
        1e-2, "of the duration", "shorter segments may vanish in one step; longer ones shrink by a tenth first"
    )
    aside: float = tuned(0.1, "of the duration", "changes farther from each other do not meet within a step")
    vanished: float = tuned(1e-8, "of the duration", "a segment so short is taken out")
    halves: int = tuned(12, "halvings", "of a step that goes beyond a position limit")
    near: float = tuned(1e-3, "rad or m", "excess of a position limit at which a touch is put in")
    far_beyond: float = tuned(0.3, "rad or m", "the same at most, of a motion as it lands first")
    dear: float = tuned(0.05, "of the duration", "that touches of position limits may cost")
    slow: float = tuned(0.5, "of the duration", "that arcs on velocity limits may cost: they were exceeded long")
    touches: int = tuned(3, "times", "that touches are put in: one may bring about another")


@dataclass(frozen=True, kw_only=True)
class ContactPolicy:
    """Which contacts with limits of position and velocity are shortened, left or handed to another joint."""

    cases: ClassVar = PAIRS

    excess: float = tuned(1e-6, "of half a torque's range", "that a contact may take beyond a torque limit")
    inward: float = tuned(
        5e-5, "of the largest multiplier", "inward pull at which a contact is let go: the certificate's / 2"
    )
    whole: float = tuned(0.02, "of a contact", "that is left at an end is not worth another contact")
    least: float = tuned(0.1, "of a contact", "that is let go at first, at least")
    end: float = tuned(0.25, "of a contact", "that is let go where its beginning or its end would rather be")
    near: float = tuned(1e-3, "of the duration", "a carrier's switches so near a contact are part of it")
    at: float = tuned(1e-6, "of the duration", "two changes so near each other are at one time")


@dataclass(frozen=True, kw_only=True)
class SingularPolicy:
    """Tuned numbers of singular controls: their insertion and initial guess."""

    cases: ClassVar = PAIRS

    apart: float = tuned(0.05, "of the duration", "stretches of one joint that are nearer belong together")
    few: int = tuned(3, "coefficients", "of a singular control that are fitted to the torque before")
    many: int = tuned(15, "coefficients", "of a singular control, at most", PAIRS + "; random arms (RR, seed 1)")
    more: int = tuned(2, "coefficients", "that come at a time, while the switching function is not zero")
    inside: float = tuned(0.95, "of the way to a limit", "that a singular control may go at first")
    on_limit: float = tuned(0.9, "of the way to a limit", "at which a torque of a mesh counts as on it")
    reached: float = tuned(1e-4, "of a torque's range", "from a limit that a free torque has reached")
    rise: float = tuned(0.2, "of the rise of H that justifies a bang arc", "at which that arc begins and ends")
    short: float = tuned(0.05, "of a segment", "a shorter singular control is left to the bang arc next to it")
    samples: int = tuned(200, "samples", "of a segment, that a singular control is fitted to")
    long: float = tuned(0.05, "of the duration", "a shorter stretch of a mesh off all limits is read as bang arcs")
    first: float = tuned(1e-3, "of the duration", "bang arc at the start, before the first singular control")
    in_arc: int = tuned(50, "samples", "of a mesh's torque in an arc, for its mean")
    along: int = tuned(100, "samples", "of a mesh's torques along a stretch")


@dataclass(frozen=True, kw_only=True)
class SwitchingPolicy:
    """Tuned numbers of the correction of switching structures by Pontryagin's conditions."""

    cases: ClassVar = PAIRS

    rounds: int = tuned(40, "rounds", "a contact that is left by shorter and shorter bounces takes two for each")
    least: float = tuned(
        5e-5, "-", "decrease of H that justifies a bang arc or a longer control: half of the certificate's tolerance"
    )
    worse: float = tuned(0.05, "of the worst decrease of H", "stretches below it wait for another round")
    drift: float = tuned(1e-5, "-", "of H along an arc, beyond which steps are too long: a tenth of certified")
    astray: float = tuned(1e-3, "-", "the same where no extremal was found: long steps may be the reason")
    shorter: float = tuned(1e-11, "of the duration", "that a corrected contact gains at least, or it is left")
    trial: float = tuned(
        1 / 3, "of the budget left", "for a structure while others wait; those that lead on take a tenth"
    )
    patience: int = tuned(3, "rounds", "in a row that come no nearer: more go in circles")
    better: float = tuned(0.7, "of the least worst sign", "what counts as nearer")
