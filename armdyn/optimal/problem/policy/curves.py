"""Tuned numbers of curves, and of the sequence of quadratic programs that solves them."""

from dataclasses import dataclass, replace
from typing import ClassVar, Self

from armdyn.optimal.problem.policy.tuned import by_kind, tuned

TRAINED = "Panda and UR5, ten random pairs each (seed 1)"
MARGINS = "UR3 1, UR10 1, xArm7 0, TIAGo's arms, Baxter 0, Panda 0 and 2, UR5 0 and 1 of docs/arms.md"
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
    mesh_starts: int = by_kind("guesses", "rough curves that a mesh starts from: one takes 0.04 s", "RR, RRR")
    more_starts: int = tuned(6, "guesses", "if the first has failed", "bravo7")
    slack: float = tuned(1.2, "of the time at the velocity limits", "duration of a guess that cruises")
    gentle: float = tuned(
        2.0,
        "of the time with ramps of limited jerk",
        "the same through via points; with 1.2 two of 13 motions are not found, from guesses without ramps five",
        "Panda, UR5, 13 random pairs with a via point",
    )
    pace: float = tuned(
        1.5,
        "-",
        "duration over that guess's of a slower one, and the inverse of a faster one's, if it has failed",
        "Panda, two random pairs with a via point",
    )
    patience: int = by_kind(
        "iterations",
        "of IPOPT; those that converge take 20 to 60, with path constraints up to 140, with Coulomb friction up to 200",
        TRAINED + ", xArm6",
    )
    barrier: float = tuned(0.1, "scaled", "IPOPT's mu_init from a straight guess")
    warm_barrier: float = tuned(1e-6, "scaled", "IPOPT's mu_init where little has changed")
    tolerance: float = tuned(1e-7, "scaled", "of IPOPT")
    accepted: float = tuned(
        1e-5,
        "scaled",
        "error that is accepted where the duration no longer falls: with Coulomb friction joints with time to spare "
        "drift on about where their velocity turns its sign; torques are computed anew from the curve, and slowed down",
        "xArm6 with the friction of its URDF",
    )
    accepted_after: int = tuned(8, "iterations", "in a row; those that converge need 3", "xArm6")
    smooth: float = tuned(1e-3, "-", "weight of the mean squared torque against the duration: the fastest is unique")
    travel: float = tuned(
        1e-4,
        "-",
        "weight of mean squared velocities where time may be spent on calm joints; with twice that some motions take "
        "more time than allowed",
        RESTING,
    )
    torque_steps: float = tuned(
        7.5e-5,
        "-",
        "weight of squared torque steps likewise: torques vary a fifth (UR5) to two fifths (Panda) less; with 3e-5 "
        "resting joints travel a tenth less, torques vary a tenth more",
        RESTING,
    )
    resting_speed: float = tuned(
        1e-3,
        "of a velocity limit",
        "mean speed below which joints with less far to go are weighted more; at 0.02 resting joints travel "
        "twice as far",
        RESTING,
    )
    in_flight: float = tuned(
        1e-5, "of a limit", "reserve of velocity limits where a motion in flight at an end cannot be slowed down", "UR5"
    )
    steep_in_flight: float = tuned(1e-3, "of a limit", "reserve of rates of torques likewise", "UR5")
    checks: int = tuned(24, "places", "of an interval at which torques are checked")
    eager: float = tuned(1.5, "-", "times a torque's excess between points is the margin of the nearest point")
    eager_steps: float = tuned(1.2, "-", "the same between steps, as torques are soon checked again", MARGINS)
    margin_decrease: float = tuned(
        0.3,
        "-",
        "multiplies the slack of a torque between points, by which a margin is reduced between steps",
        MARGINS,
    )
    decrease_rounds: int = tuned(
        4, "rounds", "in which margins may fall; with 3 xArm7 1 is 0.16 % slower, with 6 bravo7 1 fails", MARGINS
    )
    margin_added: float = tuned(1e-5, "of half the range", "added to each margin, or the excess only halves")
    small_excess: float = tuned(5e-5, "of half the range", "excess of which slowing down removes half")
    calm_excess: float = tuned(
        3e-3, "of half the range", "excess that is accepted where time is then spent on calm joints"
    )
    active_slack: float = tuned(
        0.03,
        "of half the range",
        "slack of a point whose torque counts as on its bound if torques next to it exceed theirs",
        "Baxter 1",
    )
    rounds: int = tuned(8, "rounds", "of tightening limits that are exceeded between the points")
    profile_rounds: int = tuned(3, "rounds", "the same of the joints' profiles")
    profile_samples: int = tuned(1000, "samples", "of a motion along the joints' profiles, at least")
    profile_most_samples: int = tuned(10_000, "samples", "the same, at most", "z1")
    profile_jerk_error: float = tuned(
        4e-3,
        "of a jerk limit",
        "error between samples of a motion along profiles: with 1e-2 motions are 0.01 to 0.1 % slower, with half as "
        "many samples",
        "thirteen arms, seed 9997",
    )
    velocity_error: float = tuned(
        1e-5,
        "of a velocity limit",
        "estimated error of the replay's velocities, for the choice of samples, and a reserve of the limits: "
        "with 2e-6 there are 1.35 (UR5) to 1.6 (Kinova) times as many samples",
        "Panda, UR5, xArm7, Kinova, TIAGo Pro, pairs 0 to 3 of docs/arms.md",
    )
    velocity_error_in_flight: float = tuned(
        5e-7,
        "of a velocity limit",
        "the same where a motion cannot be slowed down; with 1e-5 replays exceed limits by up to 3e-5, with 2e-6 by up "
        "to 3e-6",
        "Panda and UR5, random pairs in flight (seed 41)",
    )
    samples: int = tuned(8, "samples", "of an interval, at least")
    most_samples: int = tuned(64, "samples", "of an interval, by the estimate")
    steps: int = tuned(300, "samples", "of a leg, at least")
    finer: int = tuned(
        2,
        "-",
        "multiplies the samples where Coulomb friction jumps between them (a third of the replay's error), "
        "where torques may not jump, and where velocity limits do not shape the motion",
        "xArm6",
    )
    finer_still: tuple[int, ...] = tuned(
        (4, 16),
        "-",
        "multiply these samples in turn where Coulomb friction shakes a joint beyond its jerk limit, before the motion "
        "is slowed down: arms that took 1.1 to 3.7 times as long take 1.0 to 1.6 times",
        "UR5, xArm7, random arms (RRR)",
    )
    slower: float = tuned(
        0.6,
        "of an excess",
        "by which a curve is slowed down: half suffices for a torque without gravity",
        "by definition",
    )
    paces: int = tuned(
        3, "rounds", "of slowing down: the first is exact but for friction, which the next evaluates at the new pace"
    )
    slowing_factor: float = tuned(
        2.0, "-", "multiplies the slowing that the limits require: the next replay's error is elsewhere", "xArm6"
    )
    most_excess: float = tuned(1e-2, "of a limit", "excess that is more than the replay's error")
    least_share: float = tuned(1e-4, "of the time", "a smaller share is zero up to IPOPT's barrier")
    bandwidth: float = tuned(160.0, "over the duration", "of the feedback that keeps the replay on its curve")


PLANNED = "MotionBenchMaker, Panda, problems 10 to 15 of seven sets"
SLOW = "UR5, xArm7, UR10 (seeds 1 and 5), and the library's arms, pairs 0 to 2"
FREE = "Panda and UR5, ten random pairs each (seed 1)"


@dataclass(frozen=True, kw_only=True)
class SequentialPolicy:
    """Tuned numbers of sequential convexification: meshes of curves among obstacles, and iterations."""

    intervals: int = tuned(56, "intervals", "of the last mesh", PLANNED)
    shortest: float = tuned(2e-3, "of a leg", "first and last interval of the last mesh", PLANNED)
    longest: float = tuned(0.025, "of a leg", "longest interval of the last mesh: a link passes an edge", PLANNED)
    coarse: int = tuned(32, "intervals", "of the mesh on which paths are compared", PLANNED)
    least: int = tuned(10, "intervals", "of a leg between regions, however short", "25/300/25 mm: Panda, UR5")
    coarse_shortest: float = tuned(3e-3, "of a leg", "first and last interval of the coarse mesh", PLANNED)
    coarse_longest: float = tuned(0.05, "of a leg", "longest interval of the coarse mesh", PLANNED)
    poses: int = tuned(64, "poses", "of a leg at which distances are constrained", PLANNED)
    coarse_poses: int = tuned(48, "poses", "the same on the coarse mesh", PLANNED)
    within: float = tuned(0.1, "m", "pairs farther apart are out of a step's reach", PLANNED)
    pairs: int = tuned(16, "pairs", "the nearest, at every pose", PLANNED)
    passing: float = tuned(0.02, "m", "pairs that pass nearer are also constrained where they are nearest", PLANNED)
    neighbour_distance: float = tuned(
        1 / 3, "steps between poses", "distance of further such poses before and after", PLANNED
    )
    clearance_added: float = tuned(
        5e-4, "m", "added to the clearance at the poses, so that it holds between them", PLANNED
    )
    paths: int = tuned(3, "paths", "compared on the coarse mesh, the shortest first", PLANNED)
    paths_in_regions: int = tuned(2, "paths", "between regions: three differed by 0.2 %", "Panda, bins and wall")
    near_bound: float = tuned(1.02, "of the time at the velocity limits", "a faster path needs no other", PLANNED)
    dropped: float = tuned(1.05, "of the fastest path", "a slower path after the eager steps is dropped", PLANNED)
    steps: int = tuned(30, "steps", "at most", PLANNED)
    patience: int = tuned(30, "steps", "at most, if the predicted gain is not near the end", PLANNED)
    near: float = tuned(3e-4, "of the merit", "predicted gain of a step that counts as near the end", SLOW)
    free_steps: int = tuned(24, "steps", "without obstacles: those near their end by then take up to 20", SLOW)
    free_patience: int = tuned(
        11,
        "steps",
        "the same elsewhere: those that converge fast take 5; with 8 two of 170 more go to IPOPT, at 3 times the time",
        "Panda, UR5 and xArm7, 170 random pairs",
    )
    accuracy: float = tuned(
        1e-8,
        "-",
        "of a quadratic program; with 1e-5 one of 840 motions among obstacles is 14 % slower",
        "MotionBenchMaker",
    )
    free_accuracy: float = tuned(
        1e-5,
        "-",
        "the same elsewhere; with 1e-8 it takes 1.5 times as long, and 6 of 250 motions go to IPOPT, not 4",
        "Panda, UR5 and xArm7, 90 random pairs (seed 11), Panda, 250 (seed 12), docs/arms.md",
    )
    predicted: float = tuned(
        1e-4, "of the merit", "error of a prediction, or gain of a step, below which the iteration ends", PLANNED
    )
    tightened_steps: int = tuned(4, "steps", "at least after torques' bounds were tightened", FREE)
    tightened: float = tuned(0.02, "of the merit", "error of a prediction beyond which torques are not judged", FREE)
    free_torque_left: float = tuned(1e-4, "of half the range", "summed excess without obstacles", FREE)
    eager: int = tuned(4, "steps", "accepted without a test: 6 instead of 29 steps in all", PLANNED)
    trust: float = tuned(0.3, "rad or m", "radius of the trust region, first and largest", PLANNED)
    calm_trust: float = tuned(
        1.0,
        "rad or m",
        "the same where time is spent on calm joints: with 0.3 the same motions take 1.2 to 1.6 times as many steps",
        "Panda and UR5, ten random pairs each, and ten of scripts/calm.py (seed 5)",
    )
    fine_trust: float = tuned(0.1, "rad or m", "first radius if the curve has moved little", PLANNED)
    warm_trust: float = tuned(0.02, "rad or m", "first radius if the constraints have changed little", PLANNED)
    unrestricted: float = tuned(
        0.9, "of the radius", "a step within this is not restricted by the region", "by definition"
    )
    least_trust: float = tuned(1e-4, "rad or m", "radius below which no step is tried", PLANNED)
    slower: float = tuned(0.5, "of a duration", "largest increase in a step", PLANNED)
    faster: float = tuned(0.25, "of a duration", "largest decrease in a step", PLANNED)
    shrink: float = tuned(3.0, "-", "factor by which the radius falls after a rejected step", PLANNED)
    least_gain: float = tuned(0.1, "of the predicted", "least gain of an accepted step", "Nocedal and Wright")
    poor: float = tuned(0.25, "of the predicted", "gain below which the radius falls", "Nocedal and Wright")
    good: float = tuned(0.75, "of the predicted", "gain above which the radius grows", "Nocedal and Wright")
    jump: float = tuned(0.3, "s", "price of new overlaps (30 mm) at which an eager step is rejected", PLANNED)
    torque: float = tuned(0.1, "s", "price of a torque beyond its limit by half its range; 2 stalls", PLANNED)
    distance: float = tuned(10.0, "s/m", "price of a distance below the clearance at a pose", PLANNED)
    usual_duration: float = tuned(
        10.0, "s", "duration above which distances cost more in proportion", "Panda round a post at 0.005 rad/s"
    )
    other: float = tuned(0.1, "s", "price of another row beyond its limit by its scale", PLANNED)
    most_other: float = tuned(
        10.0,
        "of the duration",
        "the same, times ten if a sequence ends with violated rows",
        "25/300/25 mm: Kinova",
    )
    torque_left: float = tuned(0.5, "of half the range", "summed excess, left to slowing down", PLANNED)
    distance_left: float = tuned(1e-3, "m", "summed missing distance, left to later rounds", PLANNED)
    other_left: float = tuned(
        0.01,
        "of their scales",
        "summed excess of other rows; with 0.1 velocities may jump between legs by 9 % of their limits",
        "SCARA, random regions",
    )
    coarse_enough: float = tuned(3e-3, "of the merit", "change that ends the iteration on the coarse mesh", PLANNED)
    enough: float = tuned(1e-3, "of the merit", "the same on the last mesh", PLANNED)
    free_enough: float = tuned(1e-6, "of the merit", "the same without obstacles", FREE)
    rounds: int = tuned(8, "rounds", "on the last mesh, until distances and limits are kept", PLANNED)
    slowed: float = tuned(1e-3, "of the duration", "slowing down that ends the rounds; twice as much the next", PLANNED)
    parted: float = tuned(
        1e-3,
        "of the velocity limits",
        "larger jumps of velocities between legs make a curve no motion; converged ones have 1e-4 at most",
        "UR5, Panda, SCARA and three-link arms, 40 random regions",
    )
    switching: int = tuned(10, "intervals", "from either end in which torques change fast", PLANNED)
    switch_margin: float = tuned(0.02, "of half the range", "of torques there, at first", PLANNED)
    end_margin: float = tuned(0.15, "of half the range", "of torques in the first and last interval, at first", PLANNED)
    kept: float = tuned(2e-5, "of the duration", "reserve of velocity limits for following the curve", PLANNED)
    smooth: float = tuned(1e-5, "s", "weight of squared accelerations over velocity limits; costs 0.2 %", PLANNED)
    smooth_short: float = tuned(3e-4, "s", "the same between regions, for the longest leg", "25/300/25 mm: Panda, UR5")

    @property
    def without_obstacles(self) -> Self:
        """The numbers for curves without distance constraints."""
        enough = self.free_enough
        steps, patience, accuracy = self.free_steps, self.free_patience, self.free_accuracy
        return replace(
            self,
            steps=steps,
            patience=patience,
            accuracy=accuracy,
            enough=enough,
            predicted=enough,
            torque_left=self.free_torque_left,
        )
