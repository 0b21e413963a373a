"""Numbers of motions that are planned anew while the arm moves."""

from dataclasses import dataclass
from typing import ClassVar

from armdyn.optimal.task.policy.tuned import tuned

MANY = "the same, 1,400 goals (seeds 1, 4, 7, 16, 18, 31 and 33)"


@dataclass(frozen=True, kw_only=True)
class LivePolicy:
    """How a motion from a moving state is laid out, improved and checked, and how the arm is stopped."""

    cases: ClassVar = (
        "Panda, goals moved by up to 0.2 rad or 5 cm: twelve random pairs (seed 1), 200 goals (seeds 4 and 7)"
    )

    intervals: int = tuned(24, "intervals", "of the curve; 28 take a quarter more time for 0.01 % of the duration")
    shortest: float = tuned(5e-3, "of the duration", "first and last interval; 1e-2 is 0.1 % slower")
    looks: int = tuned(24, "places", "of an interval at which limits are checked; a multiple of 4")
    smooth: float = tuned(1e-6, "s", "weight of squared accelerations over velocity limits; costs 0.02 %")
    torque: float = tuned(
        0.3,
        "of the longest guess",
        "price of a torque beyond its limit by half its range; 0.02: short motions take 40 steps",
    )
    unmet: float = tuned(
        0.1, "of half the range", "torques beyond their limits that a step promises, above which their price rises"
    )
    dearer: float = tuned(2.0, "-", "factor by which it rises then", MANY)
    rate: float = tuned(
        3.0,
        "1",
        "price of a velocity beyond its limit, times the duration; rows' multipliers may add up to 1: with that price "
        "some motions end beyond a limit",
        MANY,
    )
    distance: float = tuned(10.0, "s/m", "price of a distance that is missing at a pose")
    trust: float = tuned(0.3, "rad or m", "radius of the first step")
    lively: int = tuned(
        2, "steps", "beyond torque limits, after which the greatest one falls: excesses fall with its square"
    )
    calmer: float = tuned(0.5, "-", "factor by which it falls then at every such step")
    falling: int = tuned(
        4, "steps", "such steps, after which no margin falls: some margins and curves alternate for ever", MANY
    )
    stuck: float = tuned(0.03, "of the greatest step", "shorter ones only make sure that limits are kept")
    least_reach: float = tuned(0.003, "of the greatest step", "least radius of a step")
    proximal: float = tuned(
        1.0, "of smooth", "weight of the squared change of accelerations: joints with time to spare"
    )
    shrink: float = tuned(3.0, "-", "factor by which the radius falls after a step that makes things worse")
    slower: float = tuned(0.5, "of the duration", "most that it grows in a step")
    faster: float = tuned(0.25, "of the duration", "most that it falls in a step")
    poor: float = tuned(0.25, "of the promised", "gain below which the next step is shorter", "Nocedal and Wright")
    good: float = tuned(0.75, "of the promised", "gain above which it may be longer", "Nocedal and Wright")
    eager: int = tuned(2, "steps", "taken whatever they do")
    steps: int = tuned(20, "steps", "at most; the median is 3")
    enough: float = tuned(5e-4, "of the duration", "change of the last step of a motion that is handed out")
    accuracy: float = tuned(1e-4, "-", "of a quadratic program: rows are kept better than the spare torque")
    spare: float = tuned(
        1.5e-3, "of half the range", "torque that is left free at the least: what one step is wrong by"
    )
    least_spare: float = tuned(
        4e-4,
        "of half the range",
        "left free by a motion that is handed out: cubics between its samples take up to 1e-4",
    )
    acceleration_spare: float = tuned(
        5e-4, "of the limit", "acceleration left free by a curve: cubics between its samples take up to 3e-4"
    )
    strict: float = tuned(1.1, "-", "times a torque's excess between the points is taken off its limit there")
    forget: float = tuned(0.45, "of a margin", "kept where nothing is exceeded, while the curve still changes")
    most_margin: float = tuned(0.9, "of half the range", "that is taken off a torque limit")
    beside_position: float = tuned(1e-5, "rad or m", "from the last motion: the arm is on it")
    beside_velocity: float = tuned(1e-3, "rad/s or m/s", "likewise")
    hand_over: float = tuned(2e-3, "s", "before the deadline at which no other step is begun, besides a step's time")
    slack: float = tuned(5e-4, "of the duration", "by which a motion from rest is slowed more than its samples ask")
    too_slow: float = tuned(
        2.0, "of the duration", "a motion from rest that must be slowed by so much is not handed out"
    )
    brakes: int = tuned(16, "durations", "tried for a stop, the shortest first")
    longer: float = tuned(1.25, "-", "from one of them to the next")
