"""Tuned numbers of replanning while the arm moves."""

from dataclasses import dataclass
from typing import ClassVar

from armdyn.optimal.problem.policy.tuned import tuned


@dataclass(frozen=True, kw_only=True)
class LivePolicy:
    """Tuned numbers of replanned motions and stops, besides those of the loop and its margins: `SequentialPolicy`."""

    cases: ClassVar = (
        "Panda, goals moved by up to 0.2 rad or 5 cm: twelve random pairs (seed 1), 200 goals (seeds 4 and 7)"
    )

    intervals: int = tuned(24, "intervals", "of the curve; 28 take a quarter more time for 0.01 % of the duration")
    shortest: float = tuned(5e-3, "of the duration", "first and last interval; 1e-2 is 0.1 % slower")
    guess_torque: float = tuned(0.7, "of half the range", "that accelerates a guess, by the inertia at its start")
    enough: float = tuned(5e-4, "of the duration", "largest change by the last step of a motion that is returned")
    reserve: float = tuned(1.5e-3, "of half the range", "of torque of a curve: the error of one step, and of cubics")
    least_reserve: float = tuned(
        4e-4,
        "of a limit",
        "reserve of torque in a motion that is returned, and of acceleration in a curve: cubics between its samples "
        "take up to 1e-4 of a torque, 3e-4 of an acceleration",
    )
    same_position: float = tuned(
        1e-5, "rad or m", "off the last motion, and 100 times that per second, counts as on it"
    )
    hand_over: float = tuned(2e-3, "s", "before the deadline, plus a step's time: no further step is begun")
    brakes: int = tuned(16, "durations", "tried for a stop, the shortest first")
    longer: float = tuned(1.25, "-", "ratio of one duration to the one before")
