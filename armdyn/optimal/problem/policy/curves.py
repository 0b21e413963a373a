"""Tuned numbers of curves, of the sequence of quadratic programs that solves them, and of replanning on the move."""

from dataclasses import dataclass
from typing import ClassVar

from armdyn.optimal.problem.policy.tuned import by_kind, tuned

TRAINED = "Panda and UR5, ten random pairs each (seed 1)"
MARGINS = "UR3 1, UR10 1, xArm7 0, TIAGo's arms, Baxter 0, Panda 0 and 2, UR5 0 and 1 of docs/arms.md"
CORNERS = "25/300/25 mm: Panda, UR5, Kinova"
RESTING = "Panda and UR5, forty random pairs each, two of whose joints rest (scripts/calm.py, seeds 5 and 6)"


@dataclass(frozen=True, kw_only=True)
class CurvePolicy:
    """Tuned numbers of curves: their layout, solver, margins and replay."""

    cases: ClassVar = TRAINED

    cruises: bool = by_kind("-", "velocity limits shape the motion: a joint reaches its limit on its way")
    intervals: int = tuned(56, "intervals", "of a leg; 40 are 0.004 % slower, 100 as much faster")
    coarse: int = tuned(16, "intervals", "of a leg, where goals are compared: right to 1 %", "UR5: eight branches")
    shortest: float = by_kind("of a leg", "first and last interval: ramps to a velocity limit are this short")
    starts: int = by_kind("guesses", "one where velocity limits shape the motion: eight gave the same optimum")
    more_starts: int = tuned(6, "guesses", "if the first has failed", "bravo7")
    mesh_starts: int = by_kind("guesses", "rough curves that a mesh starts from: one takes 0.04 s", "RR, RRR")
    slack: float = tuned(1.2, "of the time at the velocity limits", "duration of a guess that cruises")
    gentle: float = tuned(2.0, "of the time with limited jerk", "through via points; 1.2 loses two of 13 motions")
    pace: float = tuned(
        1.5, "-", "duration of a slower guess, and the inverse of a faster one's, if the first has failed"
    )
    patience: int = tuned(300, "iterations", "of IPOPT; most take 20 to 60, with rows 140, with dry friction 200")
    tolerance: float = tuned(
        1e-7, "scaled", "of IPOPT; a hundred times that where the duration no longer falls: dry friction makes it flat"
    )
    smooth: float = tuned(1e-3, "-", "weight of the mean squared torque against the duration: the fastest is unique")
    calm: float = tuned(1e-4, "-", "weight of squared velocities and torque steps; twice that takes too long", RESTING)
    resting_speed: float = tuned(
        1e-3, "of a velocity limit", "below it joints are held back; with 0.02 they travel twice as far", RESTING
    )
    checks: int = tuned(24, "places", "of an interval at which torques are checked; a multiple of 4")
    eager: float = tuned(1.5, "-", "times a torque's excess between points is added to the nearest point's margin")
    strict: float = tuned(1.1, "-", "times that excess over the nearest point's own is the margin there", MARGINS)
    margin_kept: float = tuned(0.45, "of a margin", "kept where no limit is exceeded and the curve changes", MARGINS)
    small_excess: float = tuned(5e-5, "of half the range", "excess of which slowing down removes half")
    rounds: int = tuned(8, "rounds", "of tightening limits that are exceeded between the points, and of slowing down")
    profile_jerk_error: float = tuned(
        4e-3, "of a jerk limit", "between samples along profiles; 1e-2 is 0.01 to 0.1 % slower", "13 arms, seed 9997"
    )
    velocity_error: float = tuned(
        1e-5,
        "of a velocity limit",
        "of replays, by which samples are chosen, and a reserve; a twentieth where no motion can be slowed down",
        "Panda, UR5, xArm7, Kinova, TIAGo Pro: 2e-6 takes 1.35 to 1.6 times as many samples; in flight (seed 41)",
    )
    samples: int = tuned(8, "samples", "of an interval, at least; eight times that at most, by the estimate")
    steps: int = tuned(300, "samples", "of a leg, at least")
    finer: tuple[int, ...] = tuned(
        (2, 4, 16),
        "-",
        "multiply these samples: the first where dry friction jumps, torques may not, or velocity limits do not count; "
        "then where dry friction exceeds a jerk limit: durations of 1.1 to 3.7 become 1.0 to 1.6",
        "UR5, xArm6, xArm7, random arms (RRR)",
    )
    slower: float = tuned(0.6, "of an excess", "by which a curve is slowed: half suffices for a torque without gravity")
    most_excess: float = tuned(1e-2, "of a limit", "excess that is more than the replay's error")
    least_share: float = tuned(1e-4, "of the time", "a limit's smaller share is zero up to IPOPT's barrier")
    bandwidth: float = tuned(160.0, "over the duration", "of the feedback that keeps the replay on its curve")


@dataclass(frozen=True, kw_only=True)
class SequentialPolicy:
    """Tuned numbers of sequential convexification: meshes of curves among obstacles, and iterations."""

    cases: ClassVar = "MotionBenchMaker, Panda, problems 10 to 15 of seven sets"

    shortest: float = tuned(2e-3, "of a leg", "first and last interval of the last mesh among obstacles")
    longest: float = tuned(
        0.025, "of a leg", "longest interval of the last mesh: a link passes an edge; on the coarse one twice that"
    )
    least: int = tuned(10, "intervals", "of a leg between regions, however short", CORNERS)
    within: float = tuned(0.1, "m", "pairs farther apart are out of a step's reach")
    pairs: int = tuned(16, "pairs", "the nearest, at every pose")
    passing: float = tuned(0.02, "m", "pairs that pass nearer are also constrained where they are nearest")
    clearance_added: float = tuned(5e-4, "m", "added to the clearance at the poses, so that it holds between them")
    paths: int = tuned(3, "paths", "compared on the coarse mesh, the shortest first")
    near_bound: float = tuned(1.02, "of the time at the velocity limits", "a faster path needs no other")
    steps: int = tuned(30, "steps", "at most; those that converge take up to 20")
    accuracy: float = tuned(
        1e-6,
        "-",
        "of a quadratic program; 1e-5 makes one of 840 motions 14 % slower, 1e-8 takes 1.5 times as long",
        "90 random pairs",
    )
    tightened: float = tuned(0.02, "of the merit", "error of a prediction beyond which torques are not judged", TRAINED)
    undamped: int = tuned(2, "changes", "of exceeded torques; each further one halves the largest radius", "RRR")
    eager: int = tuned(4, "steps", "accepted without a test: 6 instead of 29 steps in all")
    trust: float = tuned(0.3, "rad or m", "largest and first trust region's radius; a third where little has changed")
    least_trust: float = tuned(1e-4, "rad or m", "radius below which no step is tried")
    stretch: float = tuned(0.8, "of a duration per rad or m", "largest change in a step, over the radius")
    poor: float = tuned(0.25, "of the predicted", "gain below which the radius falls", "Nocedal and Wright")
    good: float = tuned(0.75, "of the predicted", "gain above which the radius grows", "Nocedal and Wright")
    price: float = tuned(
        0.3, "of the guess's duration", "of a torque half its range beyond its limit, of a row by its scale; 2 stalls"
    )
    distance: float = tuned(14.0, "of the guess's duration per m", "price of a pose's distance below the clearance")
    rise: float = tuned(10.0, "-", "raises all prices where no step is better and rows are violated", CORNERS)
    left: float = tuned(
        0.01,
        "of their scales",
        "summed excess of rows of a converged curve; with 0.1 speeds jump between legs",
        "SCARA",
    )
    enough: float = tuned(
        3e-4,
        "of the merit",
        "change that ends an iteration, slowing down that ends rounds, jump of speeds at legs",
    )
    free_enough: float = tuned(1e-6, "of the merit", "change that ends the iteration without obstacles", TRAINED)
    smooth: float = tuned(1e-5, "s", "weight of squared accelerations over velocity limits; costs 0.2 %")
    smooth_short: float = tuned(
        2e-4, "s", "the same between regions, for the longest leg; 3e-4 cost up to 1 %, 1e-4 misses small ones", CORNERS
    )


@dataclass(frozen=True, kw_only=True)
class LivePolicy:
    """Tuned numbers of replanned motions and stops, besides those of the loop and its margins: `SequentialPolicy`."""

    cases: ClassVar = "Panda, goals moved by 0.2 rad or 5 cm: 12 random pairs (seed 1), 200 goals (seeds 4 and 7)"

    intervals: int = tuned(24, "intervals", "of the curve; 28 take a quarter more time for 0.01 % of the duration")
    shortest: float = tuned(5e-3, "of the duration", "first and last interval; 1e-2 is 0.1 % slower")
    guess_torque: float = tuned(0.7, "of half the range", "that accelerates a guess, by the inertia at its start")
    enough: float = tuned(5e-4, "of the duration", "largest change by the last step of a motion that is returned")
    reserve: float = tuned(1.5e-3, "of half the range", "of torque of a curve: the error of one step, and of cubics")
    least_reserve: float = tuned(
        4e-4, "of a limit", "of torque in a motion, of acceleration in a curve: cubics between samples take 1e-4, 3e-4"
    )
    same_position: float = tuned(1e-5, "rad or m", "so far off the last motion (a speed: 100 times that) is on it")
    hand_over: float = tuned(2e-3, "s", "before the deadline, plus a step's time: no further step is begun")
    brakes: int = tuned(16, "durations", "tried for a stop, the shortest first")
    longer: float = tuned(1.25, "-", "ratio of one duration to the one before")
