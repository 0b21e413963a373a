"""Every number that the paper publishes as a result, and nothing else: no other module contains one.

Kept as printed, so that the last printed digit of each is known.
"""

from dataclasses import dataclass
from typing import Self

from armdyn.models.values.spec import PlanarArmName
from armdyn.paper.printed.examples import PAYLOAD

_TABLE_3 = """
M [g]   2 pi / r [s]   k / det [N m]
21.2    0.166          2.662
31.2    0.177          2.653
51.8    0.198          2.625
100.6   0.237          2.552
121.9   0.258          2.491
130.7   0.267          2.459
150.5   0.290          2.367
200     0.324          2.232
500     0.452          1.614
1000    0.627          0.354
"""

_TABLE_4_R = """
M [g]   Example 1 [s]  Example 4 [s]
21.2    0.312          4.260
31.2    0.321          4.271
51.8    0.330          4.301
100.6   0.331          4.317
121.9   0.347          4.328
130.7   0.358          4.336
150.5   0.363          4.345
200     0.382          4.369
500     0.395          4.415
1000    0.405          4.502
"""

_TABLE_5_RR = """
M [g]   Example 2 [s]  Example 5 [s]
21.2    0.342          4.213
31.2    0.360          4.320
51.8    0.379          4.568
100.6   0.383          4.607
121.9   0.399          4.779
130.7   0.410          4.880
150.5   0.432          4.995
200     0.449          5.005
500     0.560          5.012
1000    0.584          5.029
"""

_TABLE_6_RRR = """
M [g]   Example 3 [s]  Example 6 [s]
21.2    0.566          6.202
31.2    0.582          6.218
51.8    0.601          6.229
100.6   0.625          6.235
121.9   0.651          6.248
130.7   0.683          6.260
150.5   0.701          6.275
200     0.719          6.298
500     0.723          6.354
1000    0.758          6.407
"""

_TABLE_7 = {
    1: ("0.0977",),
    4: ("1.9141",),
    2: ("0.2171", "0.1062"),
    5: ("4.7883", "1.3450"),
    3: ("0.1062", "0.5022", "0.2673"),
    6: ("8.8336", "2.5010", "0.5668"),
}

_TEXT_TIMES = {1: "0.3319", 2: "0.3837", 3: "0.6257", 4: "4.317", 5: "4.607", 6: "6.235"}

_TEXT_TORQUES = {4: ("0.3891",), 5: ("1.242", "0.3396"), 6: ("1.356", "0.5411", "0.1338")}

LARGEST_PAYLOAD = 1.0
"""Section 7: the arms "can successfully move objects with a maximum weight of 1 kg" [kg]."""


@dataclass(frozen=True)
class Printed:
    """A printed number.

    Attributes:
        value: the number.
        unit: one unit of its last printed digit.
        text: as printed.
    """

    value: float
    unit: float
    text: str

    @classmethod
    def of(cls, text: str) -> Self:
        """The number that a text is."""
        return cls(float(text), 10.0 ** -len(text.partition(".")[2]), text)


def _column(table: str, column: int) -> dict[str, Printed]:
    rows = [line.split() for line in table.strip().splitlines()[1:]]
    return {row[0]: Printed.of(row[column]) for row in rows}


_TIMES: dict[int, dict[str, Printed]] = {
    1: _column(_TABLE_4_R, 1),
    4: _column(_TABLE_4_R, 2),
    2: _column(_TABLE_5_RR, 1),
    5: _column(_TABLE_5_RR, 2),
    3: _column(_TABLE_6_RRR, 1),
    6: _column(_TABLE_6_RRR, 2),
}
TABLE_OF_ARM: dict[PlanarArmName, int] = {"r": 4, "rr": 5, "rrr": 6}
"""Table of each arm's times."""


def printed_time(example: int, payload: float) -> Printed | None:
    """Tables 4 to 6: the total time [s] of an example with a payload [kg]; None if the tables do not have it."""
    return _TIMES[example].get(_grams(payload))


def switching(payload: float) -> tuple[Printed, Printed] | None:
    """Table 3: 2π/r [s] and k/det [N m] with a payload [kg]; None if the table does not have it."""
    key = _grams(payload)
    intervals, torques = _column(_TABLE_3, 1), _column(_TABLE_3, 2)
    return (intervals[key], torques[key]) if key in intervals else None


def total_torque(example: int, payload: float = PAYLOAD) -> tuple[Printed, ...] | None:
    """Table 7: ∫ |τ| dt [N m s] of every joint; None for another payload than its 100.6 g."""
    return tuple(map(Printed.of, _TABLE_7[example])) if _grams(payload) == _grams(PAYLOAD) else None


def time_in_text(example: int) -> Printed:
    """The time [s] that sections 6.1 to 6.3 and the figures' captions give for 100.6 g."""
    return Printed.of(_TEXT_TIMES[example])


def torque_in_text(example: int) -> tuple[Printed, ...]:
    """The "optimal minimum torque" [N m] of Figures 3, 5 and 7, at the time of arrival with 100.6 g."""
    return tuple(map(Printed.of, _TEXT_TORQUES[example]))


def _grams(payload: float) -> str:
    return f"{1000 * payload:g}"
