"""The page's tables: all readings of Tables 3 to 7, the score, feasibility, the two approaches, the statements."""

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence

from armdyn.models.values.spec import PLANAR_ARMS
from armdyn.paper.claims.statements import Statement
from armdyn.paper.outcomes.case import Case
from armdyn.paper.outcomes.outcome import Outcome, by_case
from armdyn.paper.page.mathematics import scientific, typeset
from armdyn.paper.printed import published
from armdyn.paper.printed.examples import PAYLOAD, example
from armdyn.paper.printed.published import Printed
from armdyn.paper.tables.columns import TITLES, our_column, paper_column, table_line, with_numbers
from armdyn.paper.tables.rows import Row, Verdict
from armdyn.paper.tables.standing import VERDICTS, Number, number_of, standings, time_of
from armdyn.paper.tables.text_tables import Grid
from armdyn.show.markup import Html, element, join, table

_CLASS = {
    "reproduced": "good",
    "close": "near",
    "not reproduced": "bad",
    "supported": "good",
    "partly supported": "near",
    "not supported": "bad",
    "not computed": "none",
}


def tag(verdict: str) -> Html:
    """A verdict, coloured and in words."""
    return element("span", verdict, class_=f"tag {_CLASS[verdict]}")


def score(rows: Sequence[Row]) -> Html:
    """Counts of reproduced numbers and of comparisons, by table."""
    items = []
    for number, title in TITLES.items():
        own = [row for row in rows if row.table == number and row.published is not None]
        if not own:
            continue
        counts, compared = Counter(standings(own).values()), Counter(row.verdict for row in own)
        total = sum(counts.values())
        bar = (
            element("i", class_=_CLASS[verdict], style=f"width: {100 * counts[verdict] / total:.1f}%")
            for verdict in VERDICTS
            if counts[verdict]
        )
        words = f"{counts['reproduced']} of {total} numbers reproduced"
        words += f", {counts['close']} nearly" if counts["close"] else ""
        apart = ", ".join(f"{compared[verdict]} {verdict}" for verdict in VERDICTS if compared[verdict])
        small = element("small", f"{len(own)} comparisons: {apart}")
        link = element("a", f"Table {number}", href=f"#table{number}")
        items.append(element("li", element("b", link), title, element("div", *bar, class_="bar"), words, small))
    return element("ul", *items, class_="score")


def published_cell(row: Row | None, verdict: Verdict | None) -> Html:
    """A published number, marked if any reading reproduces it, or nearly."""
    if row is None or row.published is None or verdict is None:
        return element("td", "–", class_="published group")
    text = number_text(row.published, 4 if row.table == 7 else 3)
    return element("td", text, *_marked(verdict), title=verdict, class_=f"{_CLASS[verdict]} said group")


def _marked(verdict: Verdict | None) -> list[Html]:
    mark = {"reproduced": "✓", "close": "≈"}.get(verdict or "", "")
    return [element("span", mark, class_="mark", aria_hidden="true")]


def paper_grid(rows: Sequence[Row], stand: Mapping[Number, Verdict]) -> Html:
    """The paper's columns, each followed by ours in every reading."""
    number, rows = rows[0].table, with_numbers(rows)
    heads = ("robot", "example", "torque") if number == 7 else ("M [g]",)
    columns = list(dict.fromkeys((paper_column(row), our_column(row)) for row in rows))
    papers = list(dict.fromkeys(paper for paper, _ in columns))
    groups = {paper: [ours for other, ours in columns if other == paper] for paper in papers}
    cells = {(table_line(row), paper_column(row), our_column(row)): row for row in rows}
    top = [element("th", *([typeset(head)] if not papers[0] else [])) for head in heads]
    if papers[0]:
        top += [
            element("th", typeset(paper), colspan=len(ours) + 1, class_="group over") for paper, ours in groups.items()
        ]
    names = [element("th", typeset(head), class_="first" if i == 0 else "line") for i, head in enumerate(heads)]
    for ours in groups.values():
        names += [element("th", "published", class_="group"), *(element("th", typeset(name)) for name in ours)]
    body = []
    in_order = rows if number == 7 else sorted(rows, key=lambda row: row.payload_kg)
    for line in dict.fromkeys(table_line(row) for row in in_order):
        out = [element("td", typeset(str(x)), class_="first" if i == 0 else "line") for i, x in enumerate(line)]
        for paper, ours in groups.items():
            own = [cells.get((line, paper, name)) for name in ours]
            known = next((row for row in own if row is not None and row.published is not None), None)
            out.append(published_cell(known, None if known is None else stand.get(number_of(known))))
            out += [_cell(row) for row in own]
        body.append(out)
    return table([top, names] if papers[0] else [names], body)


def _cell(row: Row | None) -> Html:
    if row is None:
        return element("td")
    matched = row.published is not None and row.verdict != "not reproduced"
    return element("td", number_text(row.ours), title=row.reason, class_="matched" if matched else "")


def reasons(rows: Sequence[Row], stand: Mapping[Number, Verdict]) -> Html:
    """Every number with its verdict and reason."""
    head = [element("th", name, class_=kind) for name, kind in _REASON_COLUMNS]
    body = [
        [
            element("td", typeset(" ".join(str(x) for x in table_line(row))), class_="first"),
            element("td", typeset(", ".join(filter(None, (paper_column(row), our_column(row))))), class_="text"),
            published_cell(row, stand.get(number_of(row))),
            element("td", *([tag(row.verdict)] if row.published is not None else []), class_="text"),
            element("td", number_text(row.ours)),
            element("td", typeset(row.reason), class_="text"),
        ]
        for row in rows
    ]
    return table([head], body, class_="long")


_REASON_COLUMNS = (
    ("line", "first"), ("column", "text"), ("published", "group"), ("verdict", "text"), ("ours", ""),
    ("reason", "text"),
)  # fmt: skip


def at_a_glance(outcomes: Iterable[Outcome], rows: Iterable[Row], payload: float = PAYLOAD) -> Html:
    """Published and computed times of every arm with one payload at the tip."""
    found, stand = by_case(outcomes), standings(rows)
    names = (
        "published t_f", "minimum time under ±3 N m", "time-energy optimum",
        "published PID", "PID, payload at the tip", "PID, m → m + M", "loop at the goal, max Re λ",
    )  # fmt: skip
    head = [[element("th", "arm", class_="first"), *(element("th", typeset(name)) for name in names)]]
    body = []
    for arm in PLANAR_ARMS:
        optimal, loop = example(arm, "minimum_time").number, example(arm, "pid").number
        said, said_loop = (published.printed_time(number, payload) for number in (optimal, loop))
        closed = found.get(Case(loop, arm, "pid", payload))
        growth = None if closed is None else closed.facts.get("max_real_eigenvalue")
        stable = (
            "–" if not isinstance(growth, float) else f"{'un' if growth >= 0 else ''}stable, {growth:+.3f}\u00a01/s"
        )
        times = [
            found.get(Case(optimal, arm, "minimum_time", payload)),
            found.get(Case(optimal, arm, "time_energy", payload)),
            closed,
            found.get(Case(loop, arm, "pid", payload, "mM")),
        ]
        first, second, third, fourth = (_time(outcome) for outcome in times)
        body.append(
            [
                element("td", arm.upper(), class_="first"),
                _published_time(said, stand.get(time_of(arm, optimal, payload))),
                element("td", first),
                element("td", second),
                _published_time(said_loop, stand.get(time_of(arm, loop, payload))),
                element("td", third),
                element("td", fourth),
                element("td", stable),
            ]
        )
    return table(head, body)


def _published_time(said: Printed | None, verdict: Verdict | None) -> Html:
    if said is None:
        return element("td", "–", class_="published group")
    kind = _CLASS[verdict or "not reproduced"]
    return element(
        "td", f"{said.text} s", *_marked(verdict), title=verdict or "not compared", class_=f"{kind} said group"
    )


def grid_table(one: Grid, folded: bool = False) -> Html:
    """A table of texts, its title above it.

    Args:
        one: the table.
        folded: its note is read first, its numbers on demand; else the note is below.
    """
    head = [element("th", typeset(name), class_="first" if i == 0 else "") for i, name in enumerate(one.header)]
    body = [
        [element("td", cell, class_="first" if i == 0 else "bad" if "✗" in cell else "") for i, cell in enumerate(line)]
        for line in one.body
    ]
    heading, numbers = element("h3", one.title), table([head], body)
    note = [element("p", typeset(one.note))] if one.note else []
    if folded:
        return join([heading, *note, element("details", element("summary", f"Its {len(body)} lines"), numbers)])
    return join([heading, numbers, *note])


def two_methods(outcomes: Iterable[Outcome]) -> Html:
    """The direct and the indirect method of every case that was solved by both."""
    names = (
        "example",
        "problem",
        "M [g]",
        "reading",
        "direct t_f [s]",
        "indirect t_f [s]",
        "difference [s]",
        "|H| at most",
    )
    body, differences = [], []
    for outcome in outcomes:
        case, indirect = outcome.case, outcome.facts.get("indirect_time_s")
        if not isinstance(indirect, float) or outcome.time is None:
            continue
        spread = outcome.facts.get("indirect_hamiltonian_spread")
        differences.append(abs(indirect - outcome.time))
        texts = (
            f"{case.example}, {case.arm.upper()}", case.kind.replace("_", " "),
            f"{1000 * case.payload:g}", case.reading,
            f"{outcome.time:.8f}", f"{indirect:.8f}", f"{indirect - outcome.time:+.1e}",
            f"{spread:.1e}" if isinstance(spread, float) else "–",
        )  # fmt: skip
        body.append([element("td", text, class_="first" if i == 0 else "") for i, text in enumerate(texts)])
    if not body:
        return element("p", "No case of this run was solved by both methods.")
    head = [element("th", typeset(name), class_="first" if i == 0 else "") for i, name in enumerate(names)]
    words = f"{len(body)} cases were solved by both; their durations differ by at most "
    return join(
        [
            element("p", words, scientific(max(differences)), " s."),
            element("details", element("summary", "All of them"), table([head], body)),
        ]
    )


def statement_table(items: Sequence[Statement]) -> Html:
    """A section's statements: claim, finding, verdict."""
    head = [element("th", name, class_="text") for name in ("", "the paper's claim", "verdict", "computed")]
    body = []
    for item in items:
        for i, check in enumerate(item.checks):
            verdict = {True: "supported", False: "not supported", None: "not computed"}[check.holds]
            label = f"{item.item} {item.topic}" if i == 0 else ""
            body.append(
                [
                    element("th", label, class_="text", scope="row"),
                    element("td", typeset(check.claim), class_="text"),
                    element("td", tag(verdict), class_="text"),
                    element("td", typeset(check.finding), class_="text"),
                ]
            )
    return table([head], body, class_="checks")


def _time(outcome: Outcome | None) -> str:
    if outcome is None:
        return "–"
    return "does not arrive" if outcome.time is None else f"{outcome.time:.4f} s"


def number_text(value: float | None, digits: int = 4) -> str:
    """A number with its decimals; a dash where there is none."""
    return "–" if value is None else f"{value:.{digits}f}"
