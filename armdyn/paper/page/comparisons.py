"""The main comparison of each of Tables 3 to 7; the other columns are folded away below it."""

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence

from armdyn.paper.page.mathematics import typeset
from armdyn.paper.page.page_tables import number_text, paper_grid, published_cell, reasons
from armdyn.paper.printed.loop import DURATION
from armdyn.paper.tables.columns import TITLES, paper_column, table_line
from armdyn.paper.tables.rows import CLOSE, Row, Verdict
from armdyn.paper.tables.standing import VERDICTS, Number, column, number_of, ratios, rms, standings
from armdyn.show.markup import Html, element, join, table

_FORMULAS = (
    ("switch_interval_s", "printed", "by that formula"),
    ("switch_interval_s", "lagrangian", "corrected, π/√|r|"),
    ("switch_torque_nm", "printed", "by that formula"),
    ("switch_torque_nm", "lagrangian", "corrected, τ limit"),
)
_TIMES = (
    ("minimum_time", "tip", "lagrangian", "minimum"),
    ("time_energy", "tip", "lagrangian", "time-energy"),
    ("pid", "tip", "lagrangian", "PID, at the tip"),
    ("pid", "mM", "lagrangian", "PID, m → m + M"),
    ("pid", "mM", "printed", "m → m + M, by (7) as printed"),
)


def comparison(number: int, rows: Iterable[Row]) -> Html:
    """One of Tables 3 to 7: its verdict, its main columns, and all other columns with their reasons, folded."""
    rows = [row for row in rows if row.table == number]
    heading = element("h3", f"Table {number}: {TITLES[number]}", id=f"table{number}")
    if not rows:
        return join([heading, element("p", "Not computed.")])
    stand = standings(rows)
    words = element("p", typeset(" ".join([_counted(stand), *_found(number, rows)])))
    if number == 7:
        halves = [[row for row in rows if (row.kind == "pid") == closed] for closed in (False, True)]
        shown = [paper_grid(half, stand) for half in halves if half]
        folded = [reasons(rows, stand)]
    else:
        shown = [_columns(rows, stand)]
        folded = [paper_grid(rows, stand), reasons(rows, stand)]
    summary = element("summary", f"All {len(rows)} comparisons, by reading, with their reasons")
    return join([heading, words, *shown, element("details", summary, *folded)])


def _counted(stand: Mapping[Number, Verdict]) -> str:
    counts = Counter(stand.values())
    reproduced, close, missing = (counts[verdict] for verdict in VERDICTS)
    if not stand:
        return "The paper has no number for the computed cases."
    parts = [f"{reproduced or 'None'} of {len(stand)} published numbers reproduced"]
    if close:
        parts.append(f"{close} within {100 * CLOSE:g} % of a reading")
    if missing:
        parts.append(f"{missing} reproduced by no reading")
    return ", ".join(parts) + "."


def _found(number: int, rows: Sequence[Row]) -> list[str]:
    """Sentences about columns, with their numbers."""
    if number == 3:
        printed = [row.ours for row in rows if (row.quantity, row.variant) == ("switch_torque_nm", "printed")]
        sizes = [abs(ours) for ours in printed if ours is not None]
        return [
            f"By the printed formula k/det is {min(sizes):.0f} to {max(sizes):.0f} with a unit that is not N m; a "
            "bang-bang torque is on its limit, 3 N m."
        ]
    if number == 7:
        return ["The integrals run up to t_f or the arrival of the motions of Tables 4 to 6."]
    words = []
    fastest = column(rows, kind="minimum_time", reading="tip")
    if fastest:
        low, high = ratios(fastest)
        span = f"{low:.2f}" if len(fastest) == 1 else f"{low:.2f} to {high:.2f}"
        words.append(f"The published t_f is {span} times the minimum time under ±3 N m.")
    for reading, name in (("tip", "at the tip"), ("mM", "read as m → m + M")):
        compared = [row for row in rows if (row.kind, row.reading, row.variant) == ("pid", reading, "lagrangian")]
        compared = [row for row in compared if not row.setup]
        pairs = column(rows, kind="pid", reading=reading, variant="lagrangian")
        if compared and not pairs:
            words.append(f"With the payload {name} no PID loop arrives within {DURATION:g} s.")
        elif pairs:
            of = f" of {len(compared)}" if len(pairs) < len(compared) else ""
            over = f"rms over {len(pairs)}{of} payloads"
            words.append(f"With the payload {name} the PID times differ by {rms(pairs):.3f} s {over}.")
    return words


def _columns(rows: Sequence[Row], stand: Mapping[Number, Verdict]) -> Html:
    """Published columns, each with ours to compare."""
    wanted: Sequence[tuple[str, ...]] = _FORMULAS if rows[0].table == 3 else _TIMES
    names = {spec[:-1]: spec[-1] for spec in wanted}
    rows = [row for row in rows if not row.setup and _spec(row) in names and (row.table != 3 or row.reading == "tip")]
    filled = {_spec(row) for row in rows if row.ours is not None}
    own = [spec[:-1] for spec in wanted if spec[:-1] in {_spec(row) for row in rows}]
    # Equation (7) as printed matters where it comes to a number.
    own = [spec for spec in own if spec in filled or spec[-1] != "printed"]
    groups: dict[str, list[tuple[str, ...]]] = {}
    for spec in own:
        paper = next(paper_column(row) for row in rows if _spec(row) == spec)
        groups.setdefault(paper, []).append(spec)
    cells = {(table_line(row), _spec(row)): row for row in rows}
    top, second = [element("th")], [element("th", typeset("M [g]"), class_="first")]
    for paper, specs in groups.items():
        extra = "minimum_time" in specs[0]
        top.append(element("th", typeset(paper), colspan=len(specs) + 1 + extra, class_="group over"))
        second.append(element("th", "published", class_="group"))
        for spec in specs:
            second.append(element("th", typeset(names[spec])))
            second += [element("th", "published ÷ minimum", class_="excess")] if "minimum_time" in spec else []
    body = []
    for line in dict.fromkeys(table_line(row) for row in sorted(rows, key=lambda row: row.payload_kg)):
        out = [element("td", str(line[0]), class_="first")]
        for specs in groups.values():
            here = [cells.get((line, spec)) for spec in specs]
            known = next((row for row in here if row is not None), None)
            out.append(published_cell(known, None if known is None else stand.get(number_of(known))))
            for row in here:
                out.append(_ours(row))
                out += [_excess(row)] if row is not None and row.kind == "minimum_time" else []
        body.append(out)
    return table([top, second], body)


def _spec(row: Row) -> tuple[str, ...]:
    return (row.quantity, row.variant) if row.table == 3 else (str(row.kind), row.reading, row.variant)


def _ours(row: Row | None) -> Html:
    if row is None:
        return element("td", "–")
    words = "no arrival" if row.ours is None and row.kind == "pid" else number_text(row.ours)
    matched = "" if row.published is None or row.verdict == "not reproduced" else "matched"
    return element("td", words, title=row.reason, class_="none" if row.ours is None else matched)


def _excess(row: Row) -> Html:
    if row.published is None or not row.ours:
        return element("td", "–", class_="excess")
    ratio = row.published / row.ours
    # A minimum is one unit long; four hold the largest.
    bar = element("i", style=f"width: {min(ratio, 4.0):.2f}em")
    return element("td", bar, f"{ratio:.2f} ×", class_="excess")
