"""Verdict on a run in words, with its numbers."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

from armdyn.reprs import USELESS_GAP, joint_unit, more_payload, optimality_words, percent
from armdyn.show.page.facts import Facts

Level = Literal["good", "fair", "bad", "none"]


@dataclass(frozen=True)
class Verdict:
    """Verdict on a motion.

    Attributes:
        level: "good": all requirements are met; "fair": usable, but one is missing; "bad": not usable; "none": a
            bare motion, of which nothing was checked.
        headline: a few words.
        said: a sentence or two.
        checks: name of each check, whether it holds (None: unknown, or not required), and the number.
        advice: remedies, a line each.
    """

    level: Level
    headline: str
    said: str
    checks: tuple[tuple[str, bool | None, str], ...] = ()
    advice: tuple[str, ...] = ()


@dataclass(frozen=True)
class Tile:
    """A headline number of a report.

    Attributes:
        label: its name.
        value: with its unit.
        note: a few words on it.
    """

    label: str
    value: str
    note: str = ""


def verdict_of(facts: Facts) -> Verdict:
    """The verdict on a run: of a minimum-time motion, of a closed loop, or on none."""
    judges = {"certificate": _of_minimum_time, "steps": _of_cycle, "arrival_rule": _of_pid}
    judges |= {"optimal_duration": _of_planned, "peak_error": _of_tracking, "feasible": _of_foreign_motion}
    if judge := next((judge for key, judge in judges.items() if key in facts), None):
        return judge(facts)
    return Verdict("none", "Not judged", "A motion without a result: nothing of it was checked.")


def tiles_of(facts: Facts, duration: float, sliding: Sequence[bool]) -> list[Tile]:
    """The headline numbers of a run.

    Args:
        facts: of a run.
        duration: of its motion [s].
        sliding: which joints slide instead of turning.
    """
    tiles = [Tile("duration", seconds(duration))]
    if "certificate" in facts:
        if (gap := facts.number("gap")) is not None:
            sure = "proven" if facts.true("gap_proven") else "not proven"
            tiles.append(Tile("above the lower bound", f"≤ {percent(max(gap, 0.0))}", sure))
        tiles += _deciding(facts)
        if (gram := facts.part("sensitivities").number("payload_mass")) is not None:
            more, cost = more_payload(gram, duration)
            tiles.append(Tile(more, f"{cost:+.3g} ms"))
        near = facts.part("clearance")
        if (distance := near.number("distance")) is not None:
            where = f"{near.text('body')} to {near.text('other')} at {seconds(near.number('time'))}"
            tiles.append(Tile("nearest", f"{1e3 * distance:.1f} mm", where))
        others = [x for x in facts.numbers("local_optima") if x is not None]
        if others:
            next_one = "the fastest of them" if facts.true("pays_effort") else "the next one"  # by J it may be another
            tiles.append(Tile("other optima met", str(len(others)), f"{next_one} takes {seconds(min(others))}"))
    if "steps" in facts:
        tiles += _cycle_tiles(facts, duration)
    way = joint_unit(sliding)
    for name, label, scale, unit, note in (
        ("optimal_duration", "the fastest takes", 1.0, " s", ""),
        ("arrival_time", "arrived", 1.0, " s", ""),
        ("settling_time", "all joints settled", 1.0, " s", ""),
        ("settled_time", "settled", 1.0, " s", ""),
        ("reference_duration", "reference", 1.0, " s", ""),
        ("error_at_end", "error at its end", 1.0, f" {way}", ""),
        ("peak_error", "largest error", 1.0, f" {way}", "on the way"),
        ("saturated", "torque on its limit", 100.0, " %", "of the time"),
    ):
        if name in facts:
            value = facts.number(name)
            text = "–" if value is None else f"{scale * value:.4g}{unit}"
            tiles.append(Tile(label, seconds(value) if unit == " s" else text, note))
    return tiles


def seconds(time: float | None) -> str:
    """A time in words."""
    return "–" if time is None else f"{time:.4f} s" if time < 100 else f"{time:.5g} s"


def _of_minimum_time(facts: Facts) -> Verdict:
    found, usable, certified = facts.number("duration") is not None, facts.true("usable"), facts.true("certified")
    level: Level = "bad" if not usable else "good" if certified else "fair"
    headline = f"Executable, {_claims(facts)}"
    if not usable:
        headline = "Not executable" if found else "No motion found"
    return Verdict(level, headline, facts.text("assessment"), _checks(facts), tuple(facts.texts("what_to_do")))


def _claims(facts: Facts) -> str:
    """Claims on the optimality of the fastest motion found."""
    gap = facts.number("gap") if facts.true("gap_proven") else None
    return optimality_words(facts.true("extremal"), gap, facts.part("certificate").number("saving"))


def _of_cycle(facts: Facts) -> Verdict:
    """Verdict on a cycle of steps."""
    from armdyn.cycle.summary import NEAR  # the optimiser is slow to import, and most pages are of no cycle

    gap = facts.number("gap")
    level: Level = "bad" if not facts.true("usable") else "good" if gap is not None and gap <= NEAR else "fair"
    near = gap is not None and gap <= USELESS_GAP
    headline = f"Executable, at most {percent(max(gap or 0.0, 0.0))} above the fastest" if near else "Executable"
    return Verdict(level, headline if level != "bad" else "Not executable", facts.text("assessment"), _checks(facts))


def _cycle_tiles(facts: Facts, duration: float) -> list[Tile]:
    """The headline numbers of a cycle of steps, besides its duration."""
    steps, again = facts.parts("steps"), facts.values.get("closed") is not False
    tiles = [Tile("an hour", f"{3600 / duration:.0f} cycles")] if again else []
    rests = dwell / duration if (dwell := facts.number("dwell")) and duration > 0 else 0.0
    if dwell and rests:
        tiles.append(Tile("at rest", seconds(dwell), f"{100 * rests:.0f} % of the cycle"))
    if (gap := facts.number("gap")) is not None:
        tiles.append(Tile("above the lower bound", f"≤ {percent(max(gap, 0.0))}", "proven, all branches"))
    longest = max(steps, key=lambda one: one.number("duration") or 0.0)
    tiles.append(Tile("longest step", seconds(longest.number("duration")), longest.text("name")))
    most = max((one.number("part") or 0.0 for one in facts.parts("decides")), default=0.0)
    return tiles + ([Tile("decided most by", f"{100 * rests:.3g} %", "rests")] if rests > most else _deciding(facts))


def _deciding(facts: Facts) -> list[Tile]:
    """The limit that decides most of the time; none: it is not known."""
    shares = [(one, 100 * (one.number("part") or 0.0)) for one in facts.parts("decides")[:1]]
    return [Tile("decided most by", f"{x:.3g} %", f"{one.text('joint')}, {one.text('limit')}") for one, x in shares]


def _checks(facts: Facts) -> tuple[tuple[str, bool | None, str], ...]:
    """Checks of a run; a value that is neither true nor false counts as not known."""
    found = [(one.text("name"), one.values.get("holds"), one.text("said")) for one in facts.parts("checks")]
    return tuple((name, holds if isinstance(holds, bool) else None, value) for name, holds, value in found)


def _of_pid(facts: Facts) -> Verdict:
    arrival, settling = facts.number("arrival_time"), facts.number("settling_time")
    rule, growth = facts.text("arrival_rule").replace("_", " "), facts.number("max_real_eigenvalue")
    exceeded = facts.texts("limits_exceeded")
    checks: list[tuple[str, bool | None, str]] = [
        ("arrives", arrival is not None, f"{seconds(arrival)} ({rule})"),
        ("all joints settle", settling is not None, seconds(settling)),
        ("keeps position and speed limits", not exceeded, "; ".join(exceeded) or "none is exceeded"),
    ]
    if growth is not None:
        checks.append(("stable at the goal", growth < 0, f"max Re λ = {growth:.4g} 1/s"))
    headline = "Did not arrive" if arrival is None else f"Arrived after {_arrival_text(arrival, exceeded)}"
    level: Level = "bad" if arrival is None or exceeded else "good"
    return Verdict(level, headline, _sentence(facts.text("message")), tuple(checks))


def _of_foreign_motion(facts: Facts) -> Verdict:
    """Verdict on a motion without a result."""
    text = "A motion without a result: its limits were checked, but not the possible gain of time."
    keeps = facts.true("feasible")
    return Verdict("good" if keeps else "bad", f"{'Keeps' if keeps else 'Breaks'} its limits", text, _possible(facts))


def _possible(facts: Facts) -> tuple[tuple[str, bool | None, str], ...]:
    """Whether the arm can execute another planner's motion."""
    from armdyn.optimal.verify.certificate import OPEN_LOOP_GROWTH  # slow to import: the optimiser

    worst, end, growth = facts.text("worst_violation"), facts.number("replay_error"), facts.number("growth")
    led = "they diverge" if end is None else f"replayed without feedback, they end {end:.1e} rad or m off its end"
    if growth is not None and growth > OPEN_LOOP_GROWTH:
        led += f"; unstable open loop (growth {growth:.2g}): other integrators end elsewhere"
    if "replay_error" not in facts:
        led = "unknown, as the arm's inertias are"
    return (
        ("keeps its limits", facts.true("feasible"), f"worst: {worst}" if worst else "none is exceeded"),
        ("its torques lead to its end", None, led),
    )


def _of_planned(facts: Facts) -> Verdict:
    """Verdict on another planner's motion, compared with the fastest."""
    ratio, feasible = facts.number("ratio"), facts.true("feasible")
    fastest = f"{seconds(facts.number('optimal_duration'))}: {_claims(facts)}"
    checks = (*_possible(facts), ("the fastest motion", facts.true("certified"), fastest))
    found = "no fastest motion was found" if ratio is None else f"takes {ratio:.4g} times as long as the fastest"
    headline = f"{'Keeps' if feasible else 'Breaks'} its limits, {found}"
    level: Level = "bad" if not feasible else "good" if facts.true("success") else "fair"
    return Verdict(level, headline, _sentence(facts.text("message")), checks, tuple(facts.texts("what_to_do")))


def _of_tracking(facts: Facts) -> Verdict:
    settled, wrong = facts.number("settled_time"), facts.number("failed_time")
    fastest, exceeded = facts.number("peak_velocity"), facts.texts("limits_exceeded")
    checks: list[tuple[str, bool | None, str]] = [
        ("settles", settled is not None, seconds(settled)),
        ("stays with its reference", wrong is None, "all the way" if wrong is None else f"lost it at {seconds(wrong)}"),
    ]
    if fastest is not None:
        said = "; ".join(exceeded) or f"largest speed {100 * fastest:.3g} % of its limit"
        checks.append(("keeps position and speed limits", not exceeded, said))
    stability = facts.part("stability")
    if "stable" in stability:
        checks.append(("stable at the goal", stability.true("stable"), stability.text("message")))
    headline = "Did not settle" if settled is None else f"Settled after {_arrival_text(settled, exceeded)}"
    level: Level = "bad" if settled is None or exceeded else "good" if wrong is None else "fair"
    return Verdict(level, headline, _sentence(facts.text("message")), tuple(checks))


def _arrival_text(time: float, exceeded: Sequence[str]) -> str:
    """Time at which a loop is at its goal, and whether it exceeded limits on the way."""
    return seconds(time) + (", but exceeded its limits" if exceeded else "")


def _sentence(text: str) -> str:
    return text[:1].upper() + text[1:] + ("." if text and not text.endswith(".") else "")
