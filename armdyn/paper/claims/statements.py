"""Sections 6.1 to 6.3 of the paper as computed statements: the claim, our numbers, the verdict."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from armdyn.models.values.spec import PlanarArmName
from armdyn.paper.claims.feasibility import holding
from armdyn.paper.claims.traits import PayloadEffect, Traits, largest_error
from armdyn.paper.outcomes.case import READINGS, Case
from armdyn.paper.outcomes.outcome import Outcome, by_case
from armdyn.paper.printed import published
from armdyn.paper.printed.examples import PAYLOAD, example
from armdyn.paper.printed.loop import DURATION

Verdict = Literal["supported", "partly supported", "not supported", "not computed"]
Outcomes = Mapping[Case, Outcome]

SECTIONS: dict[PlanarArmName, str] = {"r": "6.1", "rr": "6.2", "rrr": "6.3"}
"""The paper's section about each arm."""

_TOLERANCE = 0.005
"""Of a joint's error [rad]: a motion closer than this is "in the final position"."""
_SAME_TIME = 0.01
"""Two times that differ by less [s] are the same: where the paper's PID times are matched, they are so to 0.01 s."""


@dataclass(frozen=True)
class Check:
    """One claim of the paper with our numbers.

    Attributes:
        claim: the paper's, in words.
        finding: ours, with numbers.
        holds: whether the finding supports the claim; None: a needed result was not computed.
    """

    claim: str
    finding: str
    holds: bool | None


@dataclass(frozen=True)
class Statement:
    """One item of a section, (i) to (v).

    Attributes:
        section: "6.1" to "6.3".
        item: "(i)" to "(v)".
        topic: its heading.
        checks: the claims made there.
    """

    section: str
    item: str
    topic: str
    checks: tuple[Check, ...]

    @property
    def verdict(self) -> Verdict:
        """Over the checks that could be made."""
        held = [check.holds for check in self.checks if check.holds is not None]
        if not held:
            return "not computed"
        return "supported" if all(held) else "partly supported" if any(held) else "not supported"


def statements(arm: PlanarArmName, outcomes: Iterable[Outcome], payload: float = PAYLOAD) -> tuple[Statement, ...]:
    """A section's items (i) to (v), computed.

    The two motions compared are the minimum time and the PID loop with the payload at the tip; the effect of
    payload is given for both readings, over the payloads that the outcomes have.

    Args:
        arm: "r" for section 6.1, "rr" for 6.2, "rrr" for 6.3.
        outcomes: of any cases, in any order.
        payload: M [kg] of the items about one payload.
    """
    found = by_case(outcomes)
    optimal = Case(example(arm, "minimum_time").number, arm, "minimum_time", payload)
    loop = Case(example(arm, "pid").number, arm, "pid", payload)
    items: dict[str, Callable[[Case, Case, Outcomes], tuple[Check, ...]]] = {
        "Total time": _total_time,
        "Oscillations": _oscillations,
        "Range of speeds": _range_of_speeds,
        "Effect of payloads": _effect_of_payloads,
        "Stability": _stability,
    }
    return tuple(
        Statement(SECTIONS[arm], item, topic, check(optimal, loop, found))
        for item, (topic, check) in zip(("(i)", "(ii)", "(iii)", "(iv)", "(v)"), items.items(), strict=True)
    )


def _total_time(optimal: Case, loop: Case, found: Outcomes) -> tuple[Check, ...]:
    fastest, arrival = _time(optimal, found), _time(loop, found)
    energy = _time(replace(optimal, kind="time_energy"), found)
    also = "" if energy is None else f"; the time-energy optimum takes {energy:.4f} s"
    said, said_loop = (published.printed_time(case.example, case.payload) for case in (optimal, loop))
    checks = []
    if said is not None:
        checks.append(
            _check(
                f"The minimum time of Example {optimal.example} is {said.text} s.",
                fastest,
                lambda t: (
                    f"{t:.4f} s: the paper's is {said.value / t:.2f} times that{also}.",
                    abs(t - said.value) < _SAME_TIME,
                ),
            )
        )
    if said_loop is not None:
        near = _time(replace(loop, reading="mM"), found)
        also = "" if near is None else f"; with m → m + M {near:.3f} s"
        text = f"The PID loop of Example {loop.example} is there after {said_loop.text} s."
        if loop not in found:
            checks.append(Check(text, "Not computed.", None))
        elif arrival is None:
            checks.append(Check(text, f"It does not arrive within {DURATION:g} s{also}.", False))
        else:
            same = any(abs(t - said_loop.value) < _SAME_TIME for t in (arrival, near) if t is not None)
            checks.append(Check(text, f"{arrival:.3f} s with the payload at the tip{also}.", same))
    text = "The PID loop takes longer than the time-optimal motion."
    if fastest is None or loop not in found:
        checks.append(Check(text, "Not computed.", None))
    elif arrival is None:
        checks.append(Check(text, "The loop does not arrive, so it has no time to compare.", False))
    else:
        checks.append(Check(text, f"{arrival / fastest:.1f} times as long.", arrival > fastest))
    return tuple(checks)


def _oscillations(optimal: Case, loop: Case, found: Outcomes) -> tuple[Check, ...]:
    both = _traits(optimal, found), _traits(loop, found)

    def wider(of: Callable[[Traits], Sequence[float]], unit: str) -> Callable[[Traits, Traits], tuple[str, bool]]:
        return lambda a, b: (f"{_list(of(a))} against {_list(of(b))} {unit}.", _all_greater(of(a), of(b)))

    def fewer(a: Traits, b: Traits) -> tuple[str, bool]:
        finding = (
            f"Reversals {_list(a.reversals)} against {_list(b.reversals)}; longest way back {_list(a.swings)} against "
        )
        finding += f"{_list(b.swings)} rad; overshoot {_list(a.overshoot)} against {_list(b.overshoot)} rad."
        return finding, sum(b.reversals) <= sum(a.reversals) and max(b.swings) <= max(a.swings)

    claims: list[tuple[str, Callable[[Traits, Traits], tuple[str, bool]]]] = [
        ("The range of positions is greater in the time-optimal motion.", wider(lambda x: x.position, "rad")),
        (
            "The range of velocities is greater in the time-optimal motion.",
            wider(lambda x: [high - low for low, high in x.velocity], "rad/s"),
        ),
        ("The range of torques is greater in the time-optimal motion.", wider(lambda x: x.torque, "N m")),
        ("The PID loop shows less oscillation (abstract).", fewer),
    ]
    if optimal.arm == "r":
        claims.append(("The time-optimal motion has almost 3 oscillations (end of section 6.1).", _three_oscillations))
    else:
        claims.append(("The PID loop's torque is greater.", _greater_torque))
    return tuple(_compare(claim, *both, judge) for claim, judge in claims)


def _range_of_speeds(optimal: Case, loop: Case, found: Outcomes) -> tuple[Check, ...]:
    def judge(a: Traits, b: Traits) -> tuple[str, bool]:
        fast, slow = (max(abs(v) for pair in x.velocity for v in pair) for x in (a, b))
        finding = "; ".join(
            f"joint {i + 1}: {_range(*p)} against {_range(*q)} rad/s"
            for i, (p, q) in enumerate(zip(a.velocity, b.velocity, strict=True))
        )
        wider = all(p[1] - p[0] > q[1] - q[0] for p, q in zip(a.velocity, b.velocity, strict=True))
        return f"{finding[0].upper()}{finding[1:]}. The fastest joint is {fast / slow:.0f} times as fast.", wider

    claim = f"The range of velocities is greater in Example {optimal.example} than in Example {loop.example}."
    return (_compare(claim, _traits(optimal, found), _traits(loop, found), judge),)


def _effect_of_payloads(optimal: Case, loop: Case, found: Outcomes) -> tuple[Check, ...]:
    checks = []
    for case in (optimal, replace(optimal, kind="time_energy"), loop):
        for reading in READINGS:
            same = replace(case, reading=reading, payload=0.0)
            effect = PayloadEffect.of(
                [(c.payload, outcome.time) for c, outcome in found.items() if replace(c, payload=0.0) == same]
            )
            what = case.kind.replace("_", " ") if case.kind == "minimum_time" else _KINDS[case.kind]
            claim = f"Example {case.example}'s time increases with the payload ({what}, {_READINGS[reading]})."
            if len(effect.payloads) < 2:
                if case.kind != "time_energy":
                    checks.append(Check(claim, "Not computed.", None))
                continue
            checks.append(Check(claim, _effect_words(effect), effect.rises))
    return tuple(checks)


_KINDS = {"time_energy": "time-energy", "pid": "PID loop"}
_READINGS = {"tip": "payload at the tip", "mM": "m → m + M"}


def _effect_words(effect: PayloadEffect) -> str:
    reached, n = effect.reached, len(effect.payloads)
    if not reached:
        return f"None of {n} payloads has a time."
    (light, first), (heavy, last) = reached[0], reached[-1]
    finding = f"{first:.4g} s with {1000 * light:g} g"
    if effect.ratio is not None:
        finding += f", {last:.4g} s with {1000 * heavy:g} g: × {effect.ratio:.2f}"
    if missing := n - len(reached):
        finding += f"; {missing} of {n} payloads {'has' if missing == 1 else 'have'} no time"
    elif not effect.rises:
        rising = np.diff([t for _, t in reached]) > 0
        finding += (
            "; it falls" if not rising.any() else f"; {int(np.sum(~rising))} of {n - 1} steps up in payload shorten it"
        )
    return finding + "."


def _stability(optimal: Case, loop: Case, found: Outcomes) -> tuple[Check, ...]:
    return (*(_stays(case, found) for case in _loops(loop, found)), _holds(optimal))


def _loops(loop: Case, found: Outcomes) -> list[Case]:
    """The loop; also with equation (7) as printed, where that was computed."""
    printed = [case for case in found if case.variant == "printed" and case.payload == loop.payload]
    return [loop, *(case for case in printed if replace(case, variant="lagrangian", reading=loop.reading) == loop)]


def _stays(loop: Case, found: Outcomes) -> Check:
    claim = f"The PID loop's solution stays stable after the arrival (Example {loop.example})."
    if loop.variant == "printed":
        claim = f"The same with equation (7) as printed (Example {loop.example})."
    outcome = found.get(loop)
    if outcome is None or outcome.trajectory is None:
        return Check(claim, "Not computed.", None)
    growth = float(str(outcome.facts["max_real_eigenvalue"]))
    finding = f"The loop's rightmost eigenvalue at the goal is {growth:+.3f} 1/s: {'un' if growth >= 0 else ''}stable."
    end = outcome.trajectory.t[-1]
    if outcome.time is None:
        late = largest_error(outcome.trajectory, loop.q_goal, end / 2)
        what = f"It does not arrive: in the second half of {end:g} s a joint is up to {late:.2f} rad off"
        return Check(claim, f"{what}. {finding}", False)
    stray = largest_error(outcome.trajectory, loop.q_goal, outcome.time)
    final = largest_error(outcome.trajectory, loop.q_goal, end - 1.0)
    what = f"Joint 1 stays within {_TOLERANCE:g} rad until {end:g} s"
    if stray > _TOLERANCE * (1 + 1e-6):  # the first joint arrives exactly on the tolerance
        what += f", another joint is still up to {stray:.3f} rad off"
    what += f"; in the last second all are within {final:.1e} rad"
    return Check(claim, f"{what}. {finding}", growth < 0 and final <= _TOLERANCE)


def _holds(optimal: Case) -> Check:
    """Whether the arm can stay at the goal after t_f, at which the paper's motion ends."""
    still = holding(optimal.arm, optimal.payload, optimal.reading)
    claim = f"Example {optimal.example} is computed until t_f, where the arm is in the final position and can stay."
    return Check(
        claim, f"Holding the goal takes {_list(still.torque)} N m of {min(still.limit):g} N m.", still.possible
    )


def _three_oscillations(a: Traits, _: Traits) -> tuple[str, bool]:
    finding = "no reversal" if not sum(a.reversals) else f"{_list(a.reversals)} reversals"
    return f"{finding.capitalize()} of the velocity; overshoot {_list(a.overshoot)} rad.", sum(a.reversals) >= 2


def _greater_torque(a: Traits, b: Traits) -> tuple[str, bool]:
    return f"Peaks {_list(b.peak_torque)} against {_list(a.peak_torque)} N m.", _all_greater(
        b.peak_torque, a.peak_torque
    )


def _time(case: Case, found: Outcomes) -> float | None:
    return found[case].time if case in found else None


def _traits(case: Case, found: Outcomes) -> Traits | None:
    outcome = found.get(case)
    return None if outcome is None or outcome.trajectory is None else Traits.of(outcome.trajectory, case.q_goal)


def _check(claim: str, value: float | None, judge: Callable[[float], tuple[str, bool]]) -> Check:
    return Check(claim, "Not computed.", None) if value is None else Check(claim, *judge(value))


def _compare(
    claim: str, a: Traits | None, b: Traits | None, judge: Callable[[Traits, Traits], tuple[str, bool]]
) -> Check:
    return Check(claim, "Not computed.", None) if a is None or b is None else Check(claim, *judge(a, b))


def _all_greater(a: Sequence[float], b: Sequence[float]) -> bool:
    return all(x > y for x, y in zip(a, b, strict=True))


def _list(numbers: Iterable[float]) -> str:
    return ", ".join(f"{round(x, 6):.3g}" for x in numbers)


def _range(low: float, high: float) -> str:
    return f"{round(low, 2) + 0.0:.2f} to {high:.2f}"
