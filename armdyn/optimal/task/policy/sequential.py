"""Tuned numbers of sequential convexification."""

from dataclasses import dataclass, replace
from typing import Self

from armdyn.optimal.task.policy.tuned import tuned

TRAINED = "MotionBenchMaker, Panda, problems 10 to 15 of seven sets"
SLOW = "UR5, xArm7, UR10 (seeds 1 and 5), and the library's arms, pairs 0 to 2"
FREE = "Panda and UR5, ten random pairs each (seed 1)"


@dataclass(frozen=True, kw_only=True)
class SequentialPolicy:
    """Tuned numbers of sequential convexification: meshes of curves among obstacles, and iterations."""

    intervals: int = tuned(56, "intervals", "of the last mesh", TRAINED)
    shortest: float = tuned(2e-3, "of a leg", "first and last interval of the last mesh", TRAINED)
    longest: float = tuned(0.025, "of a leg", "longest interval of the last mesh: a link passes an edge", TRAINED)
    coarse: int = tuned(32, "intervals", "of the mesh on which paths are compared", TRAINED)
    least: int = tuned(10, "intervals", "of a leg between regions, however short", "25/300/25 mm: Panda, UR5")
    coarse_shortest: float = tuned(3e-3, "of a leg", "first and last interval of the coarse mesh", TRAINED)
    coarse_longest: float = tuned(0.05, "of a leg", "longest interval of the coarse mesh", TRAINED)
    poses: int = tuned(64, "poses", "of a leg at which distances are constrained", TRAINED)
    coarse_poses: int = tuned(48, "poses", "the same on the coarse mesh", TRAINED)
    within: float = tuned(0.1, "m", "pairs farther apart are out of a step's reach", TRAINED)
    pairs: int = tuned(16, "pairs", "the nearest, at every pose", TRAINED)
    passing: float = tuned(0.02, "m", "pairs that pass nearer are also constrained where they are nearest", TRAINED)
    neighbour_distance: float = tuned(
        1 / 3, "steps between poses", "distance of further such poses before and after", TRAINED
    )
    clearance_added: float = tuned(
        5e-4, "m", "added to the clearance at the poses, so that it holds between them", TRAINED
    )
    paths: int = tuned(3, "paths", "compared on the coarse mesh, the shortest first", TRAINED)
    paths_in_regions: int = tuned(2, "paths", "between regions: three differed by 0.2 %", "Panda, bins and wall")
    near_bound: float = tuned(1.02, "of the time at the velocity limits", "a faster path needs no other", TRAINED)
    dropped: float = tuned(1.05, "of the fastest path", "a slower path after the eager steps is dropped", TRAINED)
    steps: int = tuned(30, "steps", "at most", TRAINED)
    patience: int = tuned(30, "steps", "at most, if the predicted gain is not near the end", TRAINED)
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
        1e-4, "of the merit", "error of a prediction, or gain of a step, below which the iteration ends", TRAINED
    )
    tightened_steps: int = tuned(4, "steps", "at least after torques' bounds were tightened", FREE)
    tightened: float = tuned(0.02, "of the merit", "error of a prediction beyond which torques are not judged", FREE)
    free_torque_left: float = tuned(1e-4, "of half the range", "summed excess without obstacles", FREE)
    eager: int = tuned(4, "steps", "accepted without a test: 6 instead of 29 steps in all", TRAINED)
    trust: float = tuned(0.3, "rad or m", "radius of the trust region, first and largest", TRAINED)
    calm_trust: float = tuned(
        1.0,
        "rad or m",
        "the same where time is spent on calm joints: with 0.3 the same motions take 1.2 to 1.6 times as many steps",
        "Panda and UR5, ten random pairs each, and ten of scripts/calm.py (seed 5)",
    )
    fine_trust: float = tuned(0.1, "rad or m", "first radius if the curve has moved little", TRAINED)
    warm_trust: float = tuned(0.02, "rad or m", "first radius if the constraints have changed little", TRAINED)
    least_trust: float = tuned(1e-4, "rad or m", "radius below which no step is tried", TRAINED)
    slower: float = tuned(0.5, "of a duration", "largest increase in a step", TRAINED)
    faster: float = tuned(0.25, "of a duration", "largest decrease in a step", TRAINED)
    shrink: float = tuned(3.0, "-", "factor by which the radius falls after a rejected step", TRAINED)
    least_gain: float = tuned(0.1, "of the predicted", "least gain of an accepted step", "Nocedal and Wright")
    poor: float = tuned(0.25, "of the predicted", "gain below which the radius falls", "Nocedal and Wright")
    good: float = tuned(0.75, "of the predicted", "gain above which the radius grows", "Nocedal and Wright")
    jump: float = tuned(0.3, "s", "price of new overlaps (30 mm) at which an eager step is rejected", TRAINED)
    torque: float = tuned(0.1, "s", "price of a torque beyond its limit by half its range; 2 stalls", TRAINED)
    distance: float = tuned(10.0, "s/m", "price of a distance below the clearance at a pose", TRAINED)
    other: float = tuned(0.1, "s", "price of another row beyond its limit by its scale", TRAINED)
    most_other: float = tuned(
        10.0,
        "of the duration",
        "the same, times ten if a sequence ends with violated rows",
        "25/300/25 mm: Kinova",
    )
    torque_left: float = tuned(0.5, "of half the range", "summed excess, left to slowing down", TRAINED)
    distance_left: float = tuned(1e-3, "m", "summed missing distance, left to later rounds", TRAINED)
    other_left: float = tuned(
        0.01,
        "of their scales",
        "summed excess of other rows; with 0.1 velocities may jump between legs by 9 % of their limits",
        "SCARA, random regions",
    )
    coarse_enough: float = tuned(3e-3, "of the merit", "change that ends the iteration on the coarse mesh", TRAINED)
    enough: float = tuned(1e-3, "of the merit", "the same on the last mesh", TRAINED)
    free_enough: float = tuned(1e-6, "of the merit", "the same without obstacles", FREE)
    rounds: int = tuned(8, "rounds", "on the last mesh, until distances and limits are kept", TRAINED)
    slowed: float = tuned(1e-3, "of the duration", "slowing down that ends the rounds; twice as much the next", TRAINED)
    parted: float = tuned(
        1e-3,
        "of the velocity limits",
        "larger jumps of velocities between legs make a curve no motion; converged ones have 1e-4 at most",
        "UR5, Panda, SCARA and three-link arms, 40 random regions",
    )
    switching: int = tuned(10, "intervals", "from either end in which torques change fast", TRAINED)
    switch_margin: float = tuned(0.02, "of half the range", "of torques there, at first", TRAINED)
    end_margin: float = tuned(0.15, "of half the range", "of torques in the first and last interval, at first", TRAINED)
    kept: float = tuned(2e-5, "of the duration", "reserve of velocity limits for following the curve", TRAINED)
    smooth: float = tuned(1e-5, "s", "weight of squared accelerations over velocity limits; costs 0.2 %", TRAINED)
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
