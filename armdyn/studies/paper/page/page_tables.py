"""The page's tables: Tables 3 to 7 with verdicts, the score, feasibility, the two approaches, the statements."""

from collections.abc import Iterable, Sequence

from armdyn.models.values.spec import PAPER_ARMS
from armdyn.show.grids import Grid
from armdyn.show.markup import Html, element, join, table
from armdyn.studies.paper.claims.statements import Statement
from armdyn.studies.paper.outcomes.case import Case
from armdyn.studies.paper.outcomes.outcome import Outcome, by_case
from armdyn.studies.paper.printed import published
from armdyn.studies.paper.printed.examples import PAYLOAD, example
from armdyn.studies.paper.tables.columns import TITLES, our_column, paper_column, table_line, with_numbers
from armdyn.studies.paper.tables.rows import Row, Verdict

_CLASS = {
    "reproduced": "good",
    "close": "near",
    "not reproduced": "bad",
    "supported": "good",
    "partly supported": "near",
    "not supported": "bad",
    "not computed": "none",
}
_VERDICTS: tuple[Verdict, ...] = ("reproduced", "close", "not reproduced")


def tag(verdict: str) -> Html:
    """A verdict, coloured and in words."""
    return element("span", verdict, class_=f"tag {_CLASS[verdict]}")


def score(rows: Sequence[Row]) -> Html:
    """How many numbers of each table are reproduced."""
    items = []
    for number, title in TITLES.items():
        verdicts = [row.verdict for row in rows if row.table == number and row.published is not None]
        if not verdicts:
            continue
        counts = {verdict: verdicts.count(verdict) for verdict in _VERDICTS}
        bar = (
            element("i", class_=_CLASS[verdict], style=f"width: {100 * n / len(verdicts):.1f}%")
            for verdict, n in counts.items()
            if n
        )
        told = ", ".join(f"{n} {verdict}" for verdict, n in counts.items() if n) + f": {len(verdicts)} comparisons"
        items.append(element("li", element("b", f"Table {number}"), title, element("div", *bar, class_="bar"), told))
    return element("ul", *items, class_="score")


def paper_table(number: int, rows: Iterable[Row]) -> Html:
    """One of Tables 3 to 7: the paper's columns, each followed by ours with its verdict; the reasons below."""
    rows = [row for row in rows if row.table == number]
    heading = element("h3", f"Table {number}: {TITLES[number]}", id=f"table{number}")
    if not rows:
        return join([heading, element("p", "Not computed.")])
    if number < 7:
        return join([heading, _paper_grid(rows), _reasons(rows)])
    halves = [[row for row in rows if (row.kind == "pid") == closed] for closed in (False, True)]
    return join([heading, *(_paper_grid(half) for half in halves if half), _reasons(rows)])


def _paper_grid(rows: Sequence[Row]) -> Html:
    number, rows = rows[0].table, with_numbers(rows)
    heads = ("robot", "example", "torque") if number == 7 else ("M [g]",)
    columns = list(dict.fromkeys((paper_column(row), our_column(row)) for row in rows))
    papers = list(dict.fromkeys(paper for paper, _ in columns))
    groups = {paper: [ours for other, ours in columns if other == paper] for paper in papers}
    cells = {(table_line(row), paper_column(row), our_column(row)): row for row in rows}
    top = [element("th", *([head] if not papers[0] else [])) for head in heads]
    if papers[0]:
        top += [element("th", paper, colspan=len(ours) + 1, class_="group over") for paper, ours in groups.items()]
    names = [element("th", head, class_="first" if i == 0 else "line") for i, head in enumerate(heads)]
    for ours in groups.values():
        names += [element("th", "published", class_="group"), *(element("th", name) for name in ours)]
    body = []
    in_order = rows if number == 7 else sorted(rows, key=lambda row: row.payload_kg)
    for line in dict.fromkeys(table_line(row) for row in in_order):
        out = [element("td", str(x), class_="first" if i == 0 else "line") for i, x in enumerate(line)]
        for paper, ours in groups.items():
            own = [cells.get((line, paper, name)) for name in ours]
            said = next((row.published for row in own if row is not None), None)
            out.append(element("td", _number(said, 4 if number == 7 else 3), class_="published group"))
            out += [_cell(row) for row in own]
        body.append(out)
    return table([top, names] if papers[0] else [names], body)


def _cell(row: Row | None) -> Html:
    if row is None:
        return element("td")
    mark = tag(row.verdict) if row.published is not None else Html()
    return element("td", _number(row.ours), mark, title=row.reason)


def _reasons(rows: Sequence[Row]) -> Html:
    """Every number with its reason, folded away."""
    head = [element("th", name, class_=kind) for name, kind in _REASON_COLUMNS]
    body = [
        [
            element("td", " ".join(str(x) for x in table_line(row)), class_="first"),
            element("td", ", ".join(filter(None, (paper_column(row), our_column(row)))), class_="text"),
            element("td", _number(row.published, 4 if row.table == 7 else 3)),
            element("td", _number(row.ours)),
            element("td", *([tag(row.verdict)] if row.published is not None else [])),
            element("td", row.reason, class_="text"),
        ]
        for row in rows
    ]
    return element("details", element("summary", f"The {len(rows)} numbers with their reasons"), table([head], body))


_REASON_COLUMNS = (
    ("line", "first"), ("column", "text"), ("published", ""), ("ours", ""), ("verdict", ""), ("reason", "text"),
)  # fmt: skip


def at_a_glance(outcomes: Iterable[Outcome], payload: float = PAYLOAD) -> Html:
    """Published and computed times of every arm with one payload at the tip."""
    found = by_case(outcomes)
    names = (
        "published t_f", "minimum time under ±3 N m", "time-energy optimum",
        "published PID", "PID, payload at the tip", "PID, m\u00a0→\u00a0m\u00a0+\u00a0M",
        "loop at the goal, max Re\u00a0λ",
    )  # fmt: skip
    head = [[element("th", "arm", class_="first"), *(element("th", name) for name in names)]]
    body = []
    for arm in PAPER_ARMS:
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
                element("td", "–" if said is None else f"{said.text} s", class_="published"),
                element("td", first),
                element("td", second),
                element("td", "–" if said_loop is None else f"{said_loop.text} s", class_="published"),
                element("td", third),
                element("td", fourth),
                element("td", stable),
            ]
        )
    return table(head, body)


def grid_table(one: Grid) -> Html:
    """A table of texts, its title above and its note below."""
    head = [element("th", name, class_="first" if i == 0 else "") for i, name in enumerate(one.header)]
    body = [
        [element("td", cell, class_="first" if i == 0 else "bad" if "✗" in cell else "") for i, cell in enumerate(line)]
        for line in one.body
    ]
    parts = [element("h3", one.title), table([head], body)]
    return join([*parts, element("p", one.note)] if one.note else parts)


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
    head = [element("th", name, class_="first" if i == 0 else "") for i, name in enumerate(names)]
    told = f"{len(body)} cases were solved by both; their durations differ by at most {max(differences):.1e} s."
    return join([element("p", told), element("details", element("summary", "All of them"), table([head], body))])


def statement_table(items: Sequence[Statement]) -> Html:
    """A section's statements: claim, what was found, verdict."""
    head = [element("th", name, class_="text") for name in ("", "the paper's claim", "computed", "verdict")]
    body = []
    for item in items:
        for i, check in enumerate(item.checks):
            verdict = {True: "supported", False: "not supported", None: "not computed"}[check.holds]
            label = f"{item.item} {item.topic}" if i == 0 else ""
            body.append(
                [
                    element("th", label, class_="text", scope="row"),
                    element("td", check.claim, class_="text"),
                    element("td", check.finding, class_="text"),
                    element("td", tag(verdict), class_="text"),
                ]
            )
    return table([head], body, class_="checks")


def _time(outcome: Outcome | None) -> str:
    if outcome is None:
        return "–"
    return "does not arrive" if outcome.time is None else f"{outcome.time:.4f} s"


def _number(value: float | None, digits: int = 4) -> str:
    return "–" if value is None else f"{value:.{digits}f}"
