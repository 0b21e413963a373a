"""Tuned numbers of B-spline motions."""

from dataclasses import dataclass
from typing import ClassVar

from armdyn.optimal.task.policy.tuned import by_kind, tuned

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
    slowing_factor: float = tuned(
        2.0, "-", "multiplies the slowing that the limits require: the next replay's error is elsewhere", "xArm6"
    )
    most_excess: float = tuned(1e-2, "of a limit", "excess that is more than the replay's error")
    least_share: float = tuned(1e-4, "of the time", "a smaller share is zero up to IPOPT's barrier")
    idle: float = tuned(1e-2, "of the time", "a joint whose limits are active for less is mostly undetermined")
    bandwidth: float = tuned(160.0, "over the duration", "of the feedback that keeps the replay on its curve")
