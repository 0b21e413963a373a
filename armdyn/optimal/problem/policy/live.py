"""Tuned numbers of replanning while the arm moves."""

from dataclasses import dataclass
from typing import ClassVar

from armdyn.optimal.problem.policy.tuned import tuned

MANY = "the same, 1,400 goals (seeds 1, 4, 7, 16, 18, 31 and 33)"


@dataclass(frozen=True, kw_only=True)
class LivePolicy:
    """Tuned numbers of replanned motions and stops: layout, improvement, checks; those of steps: `SequentialPolicy`."""

    cases: ClassVar = (
        "Panda, goals moved by up to 0.2 rad or 5 cm: twelve random pairs (seed 1), 200 goals (seeds 4 and 7)"
    )

    intervals: int = tuned(24, "intervals", "of the curve; 28 take a quarter more time for 0.01 % of the duration")
    shortest: float = tuned(5e-3, "of the duration", "first and last interval; 1e-2 is 0.1 % slower")
    checks: int = tuned(24, "places", "of an interval at which limits are checked; a multiple of 4")
    guess_torque: float = tuned(0.7, "of half the range", "that accelerates a guess, by the inertia at its start")
    smooth: float = tuned(1e-6, "s", "weight of squared accelerations over velocity limits; costs 0.02 %")
    torque: float = tuned(
        0.3,
        "of the longest guess",
        "price of a torque beyond its limit by half its range; 0.02: short motions take 40 steps",
    )
    unmet: float = tuned(0.1, "of half the range", "predicted excess of torques above which their price rises")
    price_growth: float = tuned(2.0, "-", "factor of that rise", MANY)
    rate: float = tuned(
        3.0,
        "1",
        "price of a velocity beyond its limit, times the duration; multipliers may sum up to 1: with that price "
        "some motions end beyond a limit",
        MANY,
    )
    excess_steps: int = tuned(
        2, "steps", "beyond torque limits, after which the greatest step shrinks: excesses fall with its square"
    )
    step_factor: float = tuned(0.5, "-", "factor of the greatest step then, at every such step")
    decrease_steps: int = tuned(
        4, "steps", "of this kind, after which no margin is reduced: some margins and curves alternate for ever", MANY
    )
    stuck: float = tuned(0.03, "of the greatest step", "a shorter step only serves to satisfy limits")
    least_reach: float = tuned(0.003, "of the greatest step", "least radius of a step")
    proximal: float = tuned(
        1.0, "of smooth", "weight of squared changes of accelerations, which determines joints with time to spare"
    )
    eager: int = tuned(2, "steps", "accepted without a test")
    steps: int = tuned(20, "steps", "at most; the median is 3")
    enough: float = tuned(5e-4, "of the duration", "largest change by the last step of a motion that is returned")
    accuracy: float = tuned(1e-4, "-", "of a quadratic program: finer than the torque's reserve")
    torque_reserve: float = tuned(1.5e-3, "of half the range", "least reserve of torque: the error of one step")
    least_reserve: float = tuned(
        4e-4,
        "of half the range",
        "reserve of torque in a motion that is returned: cubics between its samples take up to 1e-4",
    )
    acceleration_reserve: float = tuned(
        5e-4, "of the limit", "reserve of acceleration of a curve: cubics between its samples take up to 3e-4"
    )
    strict: float = tuned(1.1, "-", "multiplies a torque's excess between points, for the margin there")
    margin_kept: float = tuned(0.45, "of a margin", "kept where no limit is exceeded, while the curve still changes")
    most_margin: float = tuned(0.9, "of half the range", "largest margin of a torque limit")
    same_position: float = tuned(1e-5, "rad or m", "within this of the last motion the arm counts as on it")
    same_velocity: float = tuned(1e-3, "rad/s or m/s", "likewise")
    hand_over: float = tuned(2e-3, "s", "before the deadline, plus a step's time: no further step is begun")
    slack: float = tuned(5e-4, "of the duration", "by which a motion from rest is slowed more than its samples require")
    too_slow: float = tuned(2.0, "of the duration", "slowing from which a motion from rest is not returned")
    brakes: int = tuned(16, "durations", "tried for a stop, the shortest first")
    longer: float = tuned(1.25, "-", "ratio of one duration to the one before")
