"""Headline of the page: whether the paper's numbers follow from its data, and the reasons."""

from collections import Counter
from collections.abc import Callable, Sequence

from armdyn.models.values.spec import PLANAR_ARMS
from armdyn.paper.claims.feasibility import largest_payload
from armdyn.paper.outcomes.outcome import Outcome
from armdyn.paper.page.mathematics import formula, scientific, typeset
from armdyn.paper.printed.published import LARGEST_PAYLOAD
from armdyn.paper.tables.rows import ARRIVAL_TOLERANCE, CLOSE, Row
from armdyn.paper.tables.standing import VERDICTS, column, growths, ratios, rms, standings
from armdyn.show.markup import Html, element, join

PAPER = "Time optimal and PID controller for armed manipulator robots"
"""The paper's title."""

_FOLLOW_NOT = "The paper’s numbers do not follow from its own data"
_PLAIN = "The paper, computed again"


def headline(rows: Sequence[Row]) -> str:
    """Headline for the result of the comparison."""
    return _FOLLOW_NOT if "not reproduced" in standings(rows).values() else _PLAIN


def lead(rows: Sequence[Row], outcomes: Sequence[Outcome]) -> Html:
    """The counts, and the accuracy of our numbers."""
    counts = Counter(standings(rows).values())
    paper = element("p", element("cite", PAPER), ": every example, table and figure, published against computed.")
    if not counts:
        words = "The paper has no number for the computed cases." if outcomes else "Nothing was computed."
        return join([paper, element("p", words)])
    reproduced, close, missing = (counts[verdict] for verdict in VERDICTS)
    big = [
        _count(reproduced, "reproduced", "good"),
        _count(close, f"within {100 * CLOSE:g} % of a reading", "near"),
        _count(missing, "reproduced by no reading", "bad"),
    ]
    score = f"Of {sum(counts.values())} numbers in the paper’s Tables 3 to 7, computed from Table 1’s arms:"
    return element("div", paper, element("p", score), element("ul", *big, class_="counts"), _accuracy(outcomes))


def _count(n: int, words: str, kind: str) -> Html:
    return element("li", element("b", str(n)), f" {words}", class_=kind)


def _accuracy(outcomes: Sequence[Outcome]) -> Html:
    optima = [one for one in outcomes if one.case.kind != "pid" and one.time is not None]
    certified = sum(bool(one.facts.get("certified")) for one in optima)
    both = [
        abs(indirect - one.time)
        for one in optima
        if isinstance(indirect := one.facts.get("indirect_time_s"), float) and one.time is not None
    ]
    words = "Ours were fitted to none of them."
    if optima:
        words += (
            f" {certified} of {len(optima)} optima are certified: replayed through an independent integrator to the "
            "goal, with Pontryagin’s conditions checked."
        )
    if both:
        words += f" {len(both)} of them were solved by a second method, too, which differs by at most "
        return element("p", words, scientific(max(both)), " s.")
    return element("p", words)


def evidence(rows: Sequence[Row], outcomes: Sequence[Outcome]) -> Html:
    """Items of evidence with numbers and links; cases that were not computed are left out."""
    parts: list[Callable[[Sequence[Row], Sequence[Outcome]], Html | None]] = [
        _minima,
        _loop,
        _laws,
        _equation,
        _payload,
        _reproduced_column,
    ]
    found = [card for part in parts if (card := part(rows, outcomes)) is not None]
    return element("div", *found, class_="evidence")


def _card(title: str, *content: str, link: str, kind: str = "bad") -> Html:
    to = element("a", "see it", href=f"#{link}")
    return element("article", element("h3", title), *(element("p", typeset(text)) for text in content), to, class_=kind)


def _minima(rows: Sequence[Row], outcomes: Sequence[Outcome]) -> Html | None:
    words = []
    for arm in PLANAR_ARMS:
        pairs = column(rows, arm=arm, kind="minimum_time", reading="tip")
        if pairs and ratios(pairs)[0] > 1:
            low, high = ratios(pairs)
            span = f"{low:.2f}" if len(pairs) == 1 else f"{low:.2f} to {high:.2f}"
            words.append(f"{span} times ({arm.upper()})")
    if not words:
        return None
    return _card(
        "The published minimum times are no minimum",
        "With the same arms, payloads and ±3 N m there are faster motions. The published t_f are "
        f"{', '.join(words)} as long as ours.",
        "R’s minimum is exact. Those of RR and RRR are the best found: a better one would widen the gap.",
        link="tables",
    )


def _loop(rows: Sequence[Row], outcomes: Sequence[Outcome]) -> Html | None:
    found = growths(outcomes, "rrr")
    unstable = [growth for growth in found if growth >= 0]
    if not unstable:
        return None
    span = f"{min(unstable):+.2f}" if len(unstable) == 1 else f"{min(unstable):+.2f} to {max(unstable):+.2f}"
    return _card(
        "Table 6’s PID loop has no settling time",
        f"The three-link loop is unstable at its own goal with {len(unstable)} of {len(found)} payloads: max Re λ is "
        f"{span} 1/s. The paper prints an arrival for each.",
        "The loop takes the PID output as an acceleration; gravity and Coriolis terms are left to it.",
        link="table6",
    )


def _laws(rows: Sequence[Row], outcomes: Sequence[Outcome]) -> Html | None:
    parts = []
    for arm in PLANAR_ARMS:
        pairs = column(rows, arm=arm, kind="time_energy", reading="tip")
        if len(pairs) > 1:
            relative = rms([(1.0, ours / published) for published, ours in pairs])
            parts.append(f"{arm.upper()} {relative:.0%}")
    also = f" Its times are not the published ones either: they differ by, rms, {', '.join(parts)}." if parts else ""
    law = formula(r"\tau^* = -B^{\mathrm T}\rho")
    return _card(
        "The printed control laws answer another question",
        join(["The law ", law, typeset(f" of (19) to (21) belongs to the optimum of ∫ (1 + ½ τᵀτ) dt.{also}")]),
        link="errata",
    )


def _equation(rows: Sequence[Row], outcomes: Sequence[Outcome]) -> Html | None:
    zero = formula(r"d_{21} = d_{31} = d_{32} = 0")
    return _card(
        "Equation (7) is not mechanics",
        join(["Its inertia matrix has ", zero, ": it is not symmetric, and energy is not conserved."]),
        "In (28) to (30) the printed + k_D θ̇ makes the loop unstable. The loops here have − k_D θ̇.",
        link="errata",
    )


def _payload(rows: Sequence[Row], outcomes: Sequence[Outcome]) -> Html | None:
    most = {arm: largest_payload(arm, "tip") for arm in PLANAR_ARMS}
    if min(most.values()) >= LARGEST_PAYLOAD:
        return None
    words = ", ".join(f"{mass:.3f} kg ({arm.upper()})" for arm, mass in most.items())
    few = sum(mass < LARGEST_PAYLOAD for mass in most.values())
    return _card(
        f"“Up to {LARGEST_PAYLOAD:g} kg” is more than {few} of the {len(most)} arms can hold",
        f"With ±3 N m the goal can be held with {words} at the tip, and no more.",
        "A motion from rest to rest there may exist all the same; the arm cannot stay.",
        link="feasibility",
    )


def _reproduced_column(rows: Sequence[Row], outcomes: Sequence[Outcome]) -> Html | None:
    pairs = column(rows, arm="r", kind="pid", reading="mM")
    near = [pair for pair in pairs if abs(pair[0] - pair[1]) <= ARRIVAL_TOLERANCE]
    if not near:
        return None
    return _card(
        "Reproduced numbers",
        f"The PID times of the one-link arm: {len(near)} of {len(pairs)} within {ARRIVAL_TOLERANCE:g} s (rms "
        f"{rms(near):.3f} s), with − k_D θ̇ and the payload read as m → m + M. No other column does.",
        link="table4",
        kind="good",
    )
