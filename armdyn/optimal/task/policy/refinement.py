"""Tuned numbers of refinement: arcs, their mesh, smooth optima."""

from dataclasses import dataclass, replace
from typing import ClassVar, Self

from armdyn.optimal.task.policy.tuned import LARGE, PLANAR, by_kind, tuned


@dataclass(frozen=True, kw_only=True)
class RefinementPolicy:
    """Tuned numbers of the refinement of a mesh's optimum to arcs."""

    cases: ClassVar = PLANAR

    extremal_is_enough: bool = by_kind(
        "-",
        "beyond two joints arcs with H = 0 are not made finer: a wrong sign no finer mesh takes back",
        "RRR, ten payloads",
    )
    lists_slower: bool = by_kind(
        "-", "beyond one joint an optimum slower than a certified one is only listed", "RR, RRR"
    )
    budget: int = by_kind(
        "integrator steps",
        "of all optima's arcs together: two thirds of what is left go to each in turn; spent in about 3 s of one core",
        "RR, RRR and random arms (poses within ±π)",
    )
    glance: int = tuned(
        8_000, "integrator steps", "to a structure of equal intervals at first: most need 4000", "RR, RRR, random pairs"
    )
    sharp: int = tuned(18_000, "integrator steps", "to one of a mesh refined at its switches", "RR, RRR, random pairs")
    sharp_at_speed: int = by_kind(
        "integrator steps",
        "the same of motions that reach velocity limits; 0: their mesh is not refined at the switches, the motion is "
        "resolved at once. With three joints 0 of 17 structures settled there, with two 3 of 14",
        "random arms",
    )
    landed_of: int = tuned(4, "motions", "of one optimum are aimed at the goal at most, until one lands", "RRR")
    sure: float = tuned(
        5.0, "-", "slower by so many times what the certified one's mesh was wrong by", "RRR, ten payloads"
    )
    slower: float = tuned(1.02, "of a certified duration", "the same, at the most", "RRR, ten payloads")
    most_intervals: int = tuned(100, "intervals", "of the finest mesh of arcs")
    most_per_arc: int = tuned(12, "intervals", "the same for each arc: 17 arcs need more than 100", "RRR, random pairs")
    blur: int = tuned(
        20, "-", "off its limits for less than this part of a fine mesh a torque is switching", "RRR 1 kg"
    )
    aims: int = tuned(8, "rounds", "of aiming arcs beside the goal")
    landed: float = tuned(1e-8, "rad or m", "goal error at which a replay has landed: the certificate's / 100")
    stray: float = tuned(5e-7, "-", "|H| that is as good as it can be: a hundredth of the certificate's tolerance")
    slowing: int = tuned(6, "rounds", "of slowing a motion down until it keeps all limits; most take one or two", LARGE)
    astray: float = tuned(1e-7, "rad or m", "from the path's own end: a tenth of the tolerance at the goal", LARGE)
    most_samples: int = tuned(2000, "samples", "of a replay that segments are checked on: six times most")
    slow_samples: int = tuned(1000, "samples", "of a motion that is slowed down or held against conditions", "RR")


@dataclass(frozen=True, kw_only=True)
class SwitchMeshPolicy:
    """Tuned numbers of mesh refinement at the switches."""

    cases: ClassVar = "RRR, random pairs"

    intervals: int = tuned(80, "intervals", "of the first mesh, at least")
    most: int = tuned(400, "knots", "more are a chattering torque's")
    rounds: int = tuned(4, "meshes", "the last one's switches are located to 1e-6 of the duration")
    shrink: float = tuned(0.1, "of an interval", "knots about a switch are so far apart")
    margin: float = tuned(0.02, "of an interval", "and so far from the others")
    least: float = tuned(1e-5, "of the duration", "a shorter interval is not divided")
    beyond: float = tuned(3e-7, "of a joint's range", "where a position limit is exceeded by more a knot is put")
    tolerance: float = tuned(1e-9, "scaled", "of a solution: times are then right to the interval")
    iterations: int = tuned(100, "iterations", "at most: most take 30")
    slower: float = tuned(1e-2, "of the duration", "a solution that is so much slower is another optimum", "RRR")


@dataclass(frozen=True, kw_only=True)
class MotionMeshPolicy:
    """Tuned numbers of mesh refinement until the motion is resolved."""

    cases: ClassVar = "random arms (RR, seed 1)"

    intervals: int = tuned(160, "intervals", "of the first mesh")
    most: int = tuned(3000, "knots", "more take a second")
    rounds: int = tuned(7, "meshes", "a switch is then located to 1e-6 of the duration")
    first_iterations: int = tuned(300, "iterations", "on the first mesh, at most", "random arms (RRR)")
    iterations: int = tuned(
        130,
        "iterations",
        "on the others, at most: of 80 problems' certified motions none took more than 72; where idle joints take more "
        "the next tie takes 6 to 50",
        "random arms (RRR)",
    )
    sharp_iterations: int = tuned(
        120, "iterations", "of the last mesh, at most: certified motions took 80", "random arms (RRR)"
    )
    tolerance: float = tuned(
        1e-7,
        "scaled",
        "of all meshes but the last: where joints are idle the way to 1e-9 takes 100 iterations, and shows no more",
        "random arms (RRR)",
    )
    barrier: float = tuned(1e-6, "scaled", "first of the interior-point method on the first mesh")
    near_barrier: float = tuned(
        1e-8,
        "scaled",
        "the same on the others: that of the solution they start from; with 1e-6 a motion on 2,000 intervals first "
        "becomes 1 % slower",
        "random arms (RRR)",
    )
    sharp_barrier: float = tuned(1e-9, "scaled", "the same on the last", "random arms (RRR)")
    push: float = tuned(1e-5, "of the room", "by which these begin off their bounds", "random arms (RRR)")
    convex: float = tuned(
        1e-5,
        "of T for half a torque's range",
        "least curvature given to torques along which T has no minimum, in their interval alone: half the iterations "
        "of one that all unknowns are given",
        "random arms (RRR)",
    )
    close: float = tuned(
        1e-5,
        "scaled",
        "error of a motion on the last mesh that will do, for its certificate judges it",
        "random arms (RRR)",
    )
    still: float = tuned(
        3e-8,
        "of the duration",
        "by which T and its barrier fall at least, or the last mesh is solved",
        "random arms (RRR)",
    )
    patience: int = tuned(12, "iterations", "in which they do", "random arms (RRR)")
    parts: int = tuned(4, "parts", "of a divided interval, at most")
    jump: float = tuned(0.03, "of half a torque's range", "between intervals that are to be divided")
    bow: float = tuned(2e-5, "of a velocity limit", "by which a constant torque strays from it within an interval")
    beyond: float = tuned(1e-6, "rad or m", "the same near a limit of position: it is that of the certificate")
    gap: float = tuned(1e-9, "of a joint's way or speed", "error of collocation in an interval: its gradient's is 1e-5")
    rough: float = tuned(1e-8, "of a joint's way or speed", "the same where knots would be too many")
    least: float = tuned(4e-6, "of the duration", "a shorter interval is not divided")
    inside: float = tuned(
        5e-6, "of a velocity limit", "kept from it: what is between an interval's middle and its ends"
    )
    kept: tuple[float, ...] = tuned(
        (3e-5, 3e-4, 3e-3),
        "of a torque limit",
        "kept for feedback, in turn, where no replay repeats the motion: it costs 0.3 to 1.5 times as much of T",
        "random arms (RRR)",
    )
    slower: float = tuned(4e-3, "of the duration", "a solution that is so much slower is another optimum", "RRR, 500 g")
    ties: tuple[float, ...] = tuned(
        (3e-6, 1e-4, 3e-4),
        "of 1 for time",
        "cost of full torques: it picks one motion of a joint that time leaves idle; the next one where none "
        "converges. Meshes after the first begin with the second: a quarter of the iterations for 5e-7 of T",
        "random arms (RR, seed 1; RRR)",
    )
    work: int = tuned(
        700_000,
        "intervals",
        "times iterations of all meshes of a problem, and its structures: 5 CPU s with three joints",
        "random arms (RRR)",
    )
    step: float = tuned(
        6.0, "intervals", "times iterations that take as long as an integrator step", "random arms (RRR)"
    )
    beaten: float = tuned(
        5e-4,
        "of a certified duration",
        "by which a mesh that is slower is given up: the second is right to 2e-4",
        "random arms (RRR)",
    )
    spare: int = tuned(200_000, "intervals", "times iterations that are left for divided meshes", "random arms (RRR)")
    rest: int = tuned(
        80_000, "intervals", "times iterations of a mesh that is solved again when none are left", "random arms (RRR)"
    )
    fewest: int = tuned(60, "iterations", "that must be left for a mesh: it is not begun else", "random arms (RRR)")
    again: int = tuned(4, "meshes", "divided where the motion is not yet certified, at most", "random arms (RRR)")
    falls: float = tuned(
        0.9,
        "of the saving before",
        "to which such a mesh brings it at least, or more divided ones do not either",
        "random arms (RRR)",
    )
    most_again: int = tuned(5000, "knots", "of such a mesh: those that were certified took 4,200", "random arms (RRR)")
    nearly: float = tuned(
        1e-3, "-", "saving, and excess over a limit, beyond which that is not worth a mesh", "random arms (RRR)"
    )
    margin: float = tuned(0.07, "of an interval", "a switch so near its end is moved off it")


@dataclass(frozen=True, kw_only=True)
class ArcsPolicy:
    """Tuned numbers of arcs: their detection on a mesh, their intervals and their solver."""

    cases: ClassVar = PLANAR

    near: float = tuned(2e-3, "of a limit", "a torque so near is on it: IPOPT's barrier leaves 1e-4")
    near_speed: float = tuned(
        2e-2, "of a limit", "the same for speeds: a constant torque holds one in the mean", "Panda, UR5"
    )
    touching: float = tuned(1e-4, "of a joint's way", "a position so near its limit touches it", "RRR, ten payloads")
    in_contact: float = tuned(5e-3, "of a joint's way", "the same for one that is held there", "RRR, ten payloads")
    switch: int = tuned(2, "intervals", "off all limits in a row are a switch; more are an arc")
    brief: float = tuned(
        1e-3,
        "of the duration",
        "likewise, however many intervals of a mesh refined at the switches",
        "RRR, random pairs",
    )
    refined: float = tuned(2e-5, "of a joint's way", "`touching` and `in_contact` on such a mesh", "RRR, random pairs")
    refined_speed: float = tuned(2e-3, "of a limit", "`near_speed` on such a mesh", "random arms (RR, seeds 1 and 9)")
    held: float = tuned(
        1e-7, "of the duration", "that hangs on a limit, for its whole size: it holds the motion back", "RRR"
    )
    shortest: float = tuned(1e-6, "of the duration", "arcs shorter than that are taken out")
    touch: int = tuned(2, "intervals", "a position limit that holds the motion back for no more is touched", "RRR")
    least_density: float = tuned(0.15, "of the mean", "least density of a mesh: an estimate may overlook something")
    per_arc: int = tuned(2, "intervals", "of the shortest arc")
    layer_samples: int = tuned(
        4000, "samples", "in which turns through dry friction are looked for", "RR with friction"
    )
    layer_reach: float = tuned(
        3.0, "widths", "of the jump at which a mesh thins out: friction is 0.5 % short", "RR with friction"
    )
    in_layers: float = tuned(0.5, "-", "part of the intervals that such turns get", "RR with friction")
    tolerance: float = tuned(1e-10, "scaled", "of IPOPT: durations then hold to about as much")
    iterations: int = tuned(150, "iterations", "of IPOPT")
    on_interval: int = tuned(
        8, "samples", "of constant torques: with one, cubics between were off by 0.27 rad/s of 62; so by 0.0012", "RRR"
    )
    barrier: float = tuned(1e-3, "scaled", "IPOPT's mu_init of arcs")
    near_barrier: float = tuned(1e-9, "scaled", "the same, and its push, where the guess is near")
    least_share: float = tuned(1e-6, "of the time", "a limit's smaller share is none: what the multipliers resolve")
    samples: int = tuned(480, "samples", "of torques that are not constant, 4 to 16 on an interval", "RRR time-energy")

    @property
    def at_switches(self) -> Self:
        """Settings for a mesh refined at its switches, whose knots stay on their limits."""
        return replace(self, touching=self.refined, in_contact=self.refined, near_speed=self.refined_speed)


@dataclass(frozen=True, kw_only=True)
class AdjointPolicy:
    """Tuned numbers of the integration of the adjoint equations along a replay."""

    cases: ClassVar = PLANAR

    precise: float = tuned(
        1e-5,
        "-",
        "by which the last two extrapolations of a segment's propagator may differ, as H feels it: what is left "
        "changes the costates' error by 4e-7 at most, less than a hundredth of its tolerance",
        "R, RR, RRR, three random RRR",
    )
    still: float = tuned(1e-9, "of the fastest joint", "a joint that moves less counts as if it moved that much")


@dataclass(frozen=True, kw_only=True)
class SmoothPolicy:
    """Tuned numbers of the search and refinement of time-energy optima."""

    cases: ClassVar = PLANAR

    starts: int = by_kind("guesses", "16 for two joints, 24 for three", "planar arms, w = 1, unbounded")
    refined: int = by_kind("optima", "so many are refined", "planar arms, w = 1, unbounded")
    coarse: int = tuned(25, "intervals", "of the search")
    iterations: int = tuned(200, "iterations", "of a guess of the search")
    fine: int = tuned(30, "intervals", "of the first solution by a high order")
    most_rough: int = tuned(120, "intervals", "of the last mesh that is rough", "RRR, 500 g and 1 kg")
    most: int = tuned(240, "intervals", "of the finest mesh", "RRR, 500 g and 1 kg")
    optimism: float = tuned(
        0.98, "of a coarse J", "what it may yet fall to: more is another optimum's", "RR, RRR, ten payloads"
    )
    steps: int = tuned(12, "solves", "spent on all optima together: one takes 0.1 to 6 s", "RRR, ten payloads")
    settled: float = tuned(1e-5, "-", "|H| at which a mesh is replayed: a tenth of the certificate's tolerance")
    warm: float = tuned(0.02, "-", "|H| below which the next solve stays where it is: 4 to 10 iterations, not 50")
    rough: float = tuned(0.05, "-", "|H| beyond which a mesh is too coarse to tell limits by")
    artefact: float = tuned(1.0, "-", "|H| beyond which it says nothing of where to look, either")
    unlikely: float = tuned(
        2.0,
        "-",
        "|H| of a first solution that most likely is none: it waits for all others",
        "RR, RRR, 500 g and 1 kg: good ones began with 1.1 at the most, artefacts with 1 to 60",
    )
    worth: float = tuned(1.5, "of the least J", "coarse optima beyond are let go; some of the best are artefacts")
    doubted: float = tuned(
        1.5,
        "of a coarse J",
        "where the high order makes it more, what the coarse mesh showed is most likely none: it waits for all others",
        "RR, RRR, 500 g and 1 kg: good ones came to 1.34 at the most, artefacts to 1.6 to 4",
    )
    samples: int = tuned(
        1920,
        "samples",
        "of the torques where lines between fewer lead the costates astray; on twice the intervals",
        "RRR, 500 g and 1 kg",
    )
