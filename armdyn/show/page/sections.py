"""The sections of a report below its plots: facts in, markup out. All text is escaped by `markup.element`."""

import html
import re
import shlex
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from armdyn.reprs import more_payload, percent, saving_words, short_time
from armdyn.show.markup import Html, element, join, table
from armdyn.show.page.facts import Facts, as_number
from armdyn.show.page.verdict import Verdict

_PATH = re.compile(r"(--?[\w-]+=|)((?:~[^/\\]*|[A-Za-z]:|)[/\\].*)", re.DOTALL)
"""An absolute path, perhaps as an option's value."""


@dataclass(frozen=True)
class Section:
    """A part of the page.

    Attributes:
        name: its anchor.
        title: its heading.
        body: its content.
        wide: it takes the page's whole width.
    """

    name: str
    title: str
    body: Html
    wide: bool = False


def verdict_section(verdict: Verdict, suffix: str = "", of: str = "") -> Section | None:
    """Section of the report with checks and remedies; None for a motion without a result.

    Args:
        verdict: on a motion.
        suffix: of the section's anchor.
        of: which motion, where there are several.
    """
    if not verdict.checks:
        return None
    signs = {True: "✓", False: "✗", None: "–"}
    words = {True: "holds", False: "does not hold", None: "not known"}
    rows = [
        element(
            "li",
            element("b", signs[holds], class_=f"sign {words[holds].replace(' ', '-')}", title=words[holds]),
            element("div", element("strong", name), element("span", value)),
        )
        for name, holds, value in verdict.checks
    ]
    parts = [element("ul", *rows, class_="checks")]
    if verdict.advice:
        lines = [element("li", options(line)) for line in verdict.advice]
        parts += [element("h3", "What you can do"), element("ul", *lines)]
    return Section(f"verdict{suffix}", titled("Checks", of), join(parts))


def options(line: str) -> Html:
    """A line of advice: its names in backticks are the command line's options."""
    pieces = re.split(r"`([a-z_]+)`", line)
    return join(element("code", f"--{piece.replace('_', '-')}") if k % 2 else piece for k, piece in enumerate(pieces))


def deciding_section(facts: Facts, duration: float) -> Section | None:
    """Share of the duration that each limit decides, and the time saved by one per cent more of it.

    Args:
        facts: of a minimum-time motion.
        duration: its [s].
    """
    shares = [(one.text("joint"), one.text("limit"), one.number("part") or 0.0, one) for one in facts.parts("decides")]
    if not shares:
        return None
    rows = [
        element(
            "li",
            element("span", f"{joint}, {limit}", class_="what"),
            element("span", element("i", style=f"width:{max(0.5, min(100.0, 100 * part)):.2f}%"), class_="share"),
            element("span", f"{100 * part:.3g} %", class_="number"),
            element(
                "span",
                f"1 % more {saving_words(part, duration, one.number('saved'), one.texts('ties'))}",
                class_="note",
            ),
        )
        for joint, limit, part, one in shares[:8]
    ]
    parts = [element("ul", *rows, class_="shares")]
    if len(shares) > 8:
        parts.append(element("p", f"and {len(shares) - 8} more, each below {100 * shares[7][2]:.2g} %", class_="note"))
    if idle := facts.texts("idle"):
        words = f"No part of the time is decided by {', '.join(idle)}."
        parts.append(element("p", words, class_="note"))
    if calm := facts.number("calm"):
        given = f"{short_time(calm, 2)} are given for calm joints: without calm, the motion is faster by this time."
        parts.append(element("p", given, class_="note"))
    return Section("decides", "Deciding limits", join(parts))


def sensitivity_section(facts: Facts, joints: Sequence[str]) -> Section | None:
    """Sensitivities of the least time to payload and limits."""
    by = facts.part("sensitivities")
    columns = [by.numbers(name) for name in ("effort_upper", "effort_lower", "velocity")]
    if by.number("payload_mass") is None or any(len(column) != len(joints) for column in columns):
        return None
    heads = ("joint", "upper torque limit", "lower torque limit", "speed limit")
    # The lower limit is a negative number: further down is less of it.
    signed = [columns[0], [None if x is None else -x for x in columns[1]], columns[2]]
    rows = [
        [name, *("–" if x is None else "0" if x == 0 else f"{1e3 * x:+.3g}" for x in values)]
        for name, *values in zip(joints, *signed, strict=True)
    ]
    more, cost = more_payload(by.number("payload_mass") or 0.0, facts.number("duration") or 0.0)
    text = f"{more} costs {cost:.3g} ms. One N m (or N) more torque, one rad/s (or m/s) more speed, in ms:"
    return Section("sensitivities", "Sensitivities", join([element("p", text), stacked(heads, rows)]))


def optima_section(facts: Facts, duration: float) -> Section | None:
    """The other optima that the search found, which are slower than the solution or, with effort, cost more."""
    others = [x for x in facts.numbers("local_optima") if x is not None]
    if not others:
        return None
    items = [
        element("li", element("b", f"{x:.4f} s"), f" {'+' * (x > duration)}{percent(x / duration - 1)}")
        for x in others[:12]
    ]
    if len(others) > 12:
        items.append(element("li", f"and {len(others) - 12} more"))
    text = "Slower motions that are optimal among their neighbours. No method proves that there is no faster one."
    if facts.true("pays_effort"):
        text = "Motions that are optimal among their neighbours, and cost more time and effort together (J) than this; "
        text += "here their durations. No method proves that no motion costs less."
    return Section("optima", "Other optima met", join([element("p", text), element("ul", *items, class_="chips")]))


def path_constraint_section(facts: Facts) -> Section | None:
    """Path constraints, via points and reserve; the clearance is one of the checks."""
    rows: list[tuple[str, str]] = []
    if via := [x for x in facts.numbers("via_times") if x is not None]:
        rows.append(("via points", "at " + ", ".join(f"{t:.4f}" for t in via) + " s"))
    for kept, what in (("effort", "of torque limits"), ("velocity", "of velocity limits")):
        parts = [x for x in facts.part("reserve").numbers(kept) if x]
        if parts:
            ends = " to ".join(f"{100 * part:.3g}" for part in sorted({min(parts), max(parts)}))
            rows.append(("kept for feedback", f"{ends} % {what}"))
    worst = [
        [one.text("name"), one.text("said"), _percent(share), "no" if one.texts("reasons") else "yes"]
        for one in facts.parts("conditions")
        if (share := one.number("share")) is not None
    ]
    body = [
        *([stacked(("limit", "<worst", "of the limit", "kept"), worst)] if worst else []),
        *([listed(rows)] if rows else []),
    ]
    return Section("path-constraints", "Path constraints", join(body)) if body else None


def controller_section(facts: Facts) -> Section | None:
    """Cost of each necessary condition of the controller's preset."""
    controller = facts.part("controller")
    rows = [
        [one.text("condition").replace("_", " "), _percent(one.number("share") or 0.0), one.text("said")]
        for one in controller.parts("costs")
    ]
    if not rows:
        return None
    text = f"{controller.text('preset')}, {controller.text('interface')} interface; one condition left out at a time."
    body = [element("p", text), stacked(("condition", "of its limit", "<costs"), rows)]
    return Section("controller", "Costs of the controller's conditions", join(body))


def _percent(share: float) -> Html:
    return td(f"{100 * share:.4g} %", over=share > 1.001)


def model_section(name: str, facts: Facts) -> Section:
    """The arm: source, payload, friction, hash."""
    model = facts.part("model")
    rows = [("robot", name), ("source", _without_folders(model.text("source")))]
    rows += [("tip", model.text("tip"))] if model.text("tip") else []
    for part in ("tool", "payload"):
        body = model.part(part)
        if (mass := body.number("mass")) is not None:
            kinds = ", ".join(shape.text("type") for shape in body.parts("shapes"))
            at = body.text("frame") or model.text("tip") or "the tip"
            rows.append((part, f"{1e3 * mass:g} g at {at}{f', {kinds}' if kinds else ''}"))
    if place := model.part("mount").numbers("position"):
        turn = ", ".join(f"{x or 0.0:.4g}" for x in model.part("mount").numbers("quaternion"))
        rows.append(("mount", f"{', '.join(f'{x or 0.0:.4g}' for x in place)} m, quaternion {turn}"))
    locked = model.part("locked").values
    if locked:
        locks = [f"{joint} = {as_number(q) or 0.0:.4g}" for joint, q in list(locked.items())[:40]]
        rows.append(("locked", ", ".join(locks)))
    friction = model.part("friction")
    for kind, unit in (("damping", "N m s/rad"), ("coulomb", "N m")):
        values = [x for x in friction.numbers(kind) if x is not None]
        if any(values):
            rows.append((f"friction, {kind}", ", ".join(f"{x:g}" for x in values) + f" {unit}"))
    rows.append(("model hash", model.text("hash")))
    return Section("model", "The arm", listed(rows))


def making_section(facts: Facts, suffix: str = "", of: str = "") -> Section | None:
    """Section on the report's origin: command, options and versions."""
    parts: list[Html] = []
    request = facts.part("request")
    if command := request.text("command"):
        parts.append(element("pre", element("code", _typed(command)), tabindex=0))
    given = request.part("options").values
    if given:
        parts.append(
            element(
                "details", element("summary", f"All options ({len(given)})"),
                listed([(name, _shown(value)) for name, value in list(given.items())[:200]]),
            )
        )  # fmt: skip
    rows = [("armdyn", facts.text("armdyn"))]
    rows += [(name, facts.part("versions").text(name)) for name in facts.part("versions").values]
    if (solve := facts.number("solve_time")) is not None:
        count = facts.number("iterations")
        steps = "" if count is None else f", {count:.0f} iterations of the solver"
        rows.append(("solved in", f"{solve:.2f} s{steps}"))
    rows = [(name, value) for name, value in rows if value]
    if rows:
        parts.append(listed(rows[:30]))
    return Section(f"making{suffix}", titled("How it was made", of), join(parts)) if parts else None


def _without_folders(text: str) -> str:
    """A word without the folders of the user's machine: of an absolute path its last name."""
    found = _PATH.fullmatch(text)
    return text if found is None else found[1] + re.split(r"[/\\]", found[2].rstrip("/\\"))[-1]


def _typed(command: str) -> str:
    """A command, its paths without folders."""
    try:
        return shlex.join(map(_without_folders, shlex.split(command)))
    except ValueError:  # it is no line of a shell
        return command


def titled(title: str, of: str) -> str:
    """A heading with the name of its motion."""
    return f"{title}: {of}" if of else title


def listed(rows: Sequence[tuple[str, str]]) -> Html:
    """HTML list of names and values; rows without a value are left out."""
    return element("dl", *(join([element("dt", name), element("dd", value)]) for name, value in rows if value))


def stacked(heads: Sequence[str], rows: Sequence[Sequence[str]]) -> Html:
    """A table whose rows are blocks where the screen is narrow; there each cell says its column, as the head does.

    Args:
        heads: of the columns; one that begins with "<" is of words, others are of numbers.
        rows: their cells, the first the row's heading; `Html` is a cell already.
    """
    columns = [(head.removeprefix("<"), head.startswith("<")) for head in heads]
    top = [th(name, class_="words") if words else th(name) for name, words in columns]
    body = []
    for heading, *cells in rows:
        row = [heading if isinstance(heading, Html) else th(heading, "row")]
        for cell, (name, words) in zip(cells, columns[1:], strict=True):
            made = cell if isinstance(cell, Html) else td(cell, class_="words") if words else td(cell)
            row.append(Html(made.replace("<td", f'<td data-column="{html.escape(name)}"', 1)))
        body.append(row)
    return table([top], body, class_="stacked")


def th(text: str, scope: str = "col", **attributes: str) -> Html:
    """A heading cell."""
    return element("th", text, scope=scope, **attributes)


def td(text: str, *, over: bool = False, **attributes: str) -> Html:
    """A cell; red if its number is over a limit."""
    look = {**attributes, "class_": "over"} if over else attributes
    return element("td", re.sub(r"(?<![^\s(±])-(?=[\d.])|(?<=\de)-(?=\d)", "−", text), **look)


def _shown(value: object) -> str:
    if isinstance(value, (list, tuple)):
        return ", ".join(map(_shown, value[:40]))
    if isinstance(value, Mapping):
        return "…"
    return {None: "–", True: "yes", False: "no"}.get(value, _without_folders(str(value)[:300]))  # type: ignore[call-overload, no-any-return]
