"""The whole study as one HTML page: tables, figures, statements and replays, without a link to the outside."""

import json
from collections.abc import Iterable, Sequence
from functools import lru_cache
from importlib.metadata import version
from importlib.resources import files
from pathlib import Path

from armdyn.files import write_whole
from armdyn.models.values.spec import PLANAR_ARMS
from armdyn.paper.claims.statements import SECTIONS, statements
from armdyn.paper.outcomes.case import Case
from armdyn.paper.outcomes.outcome import Outcome, by_case
from armdyn.paper.page.comparisons import comparison
from armdyn.paper.page.errata import errata_table
from armdyn.paper.page.figures import MARK, Picture, paper_figures, picture
from armdyn.paper.page.headline import evidence, headline, lead
from armdyn.paper.page.mathematics import typeset
from armdyn.paper.page.page_tables import (
    at_a_glance,
    grid_table,
    score,
    statement_table,
    tag,
    two_methods,
)
from armdyn.paper.printed.examples import EXAMPLES, PAYLOAD, PAYLOADS, Kind
from armdyn.paper.tables.grids import feasibility_grid, first_approach_grid
from armdyn.paper.tables.rows import ARRIVAL_TOLERANCE, CLOSE, Row
from armdyn.paper.tables.standing import VERDICTS
from armdyn.show.figures.style import INK, SOFT
from armdyn.show.markup import Html, element, fill, inline_svg, join, packed_text, script_json, viewer_script
from armdyn.show.page.report import page_fields, page_template
from armdyn.show.replay import replay_of

_SVG_COLORS = {
    INK: "var(--ink)",
    MARK: "var(--mark)",
    SOFT: "var(--soft)",
    "#d9dee4": "var(--grid)",
    "#ffffff": "transparent",
}


def write_page(
    folder: Path,
    outcomes: Sequence[Outcome],
    rows: Sequence[Row],
    payload: float = PAYLOAD,
    pictures: Sequence[Picture] | None = None,
) -> list[Path]:
    """Write index.html, which is self-contained, and Figures 2 to 7 as files.

    Args:
        folder: made if it is not there; figures go to its subfolder `figures`.
        outcomes: of any cases; missing ones are left out or marked.
        rows: of Tables 3 to 7.
        payload: M of the figures, the replays and the statements [kg].
        pictures: the figures, in any order; None: they are drawn.

    Returns:
        The files written.

    Raises:
        OSError: the folder cannot be written.
    """
    folder.mkdir(parents=True, exist_ok=True)
    if pictures is None:
        pictures = [picture(folder / "figures", figure) for figure in paper_figures(outcomes, payload)]
    pictures = sorted(pictures, key=lambda one: one.figure.number)
    sections = {
        "evidence": ("The evidence", evidence(rows, outcomes)),
        "glance": ("At a glance", join([_note_of_times(payload), at_a_glance(outcomes, rows, payload), score(rows)])),
        "tables": ("Tables 3 to 7", join([_verdicts(), *(comparison(number, rows) for number in range(3, 8))])),
        "figures": ("Figures 2 to 7", element("div", join(map(_picture, pictures)), class_="figures")),
        "replays": ("Replays", _stage(payload)),
        "statements": ("Sections 6.1 to 6.3", _statements(outcomes, payload)),
        "errata": ("Equations", errata_table()),
        "approaches": ("Two approaches", _approaches(outcomes)),
        "feasibility": ("Feasibility", grid_table(feasibility_grid())),
        "what": ("Method", _methods(payload)),
    }
    template = files(__package__).joinpath("page.html").read_text("utf-8")
    parts = {
        "title": join([headline(rows)]),
        "lead": lead(rows, outcomes),
        "nav": join(element("a", title, href=f"#{name}") for name, (title, _) in sections.items()),
        "body": join(
            element("section", element("h2", title), content, id=name) for name, (title, content) in sections.items()
        ),
        "footer": join([_FOOTER.format(version("armdyn"))]),
        "replays": script_json(_replays(outcomes, payload)),
    }
    written = [file for one in pictures for file in one.files]
    return [*written, write_whole(folder / "index.html", fill(template, parts).encode())]


_FOOTER = (
    "armdyn {}. The 3D viewer is MeshCat (MIT License, Copyright (c) 2018 Robin Deits) with three.js (MIT License, "
    "Copyright (c) 2010-2021 three.js authors), dat.GUI (Apache License 2.0), msgpack-lite, event-lite and CCapture.js "
    "(MIT License), ieee754 (BSD 3-Clause License)."
)


def _methods(payload: float) -> Html:
    items = (
        "Examples 1 to 3 are solved twice. As stated: minimum time under ±3 N m, by a global search, collocation, "
        "exact switching times, and a replay through an independent integrator with Pontryagin's conditions checked. "
        "And as the optimum of ∫ (1 + ½ τᵀτ) dt without a torque limit, to which the paper's printed laws (19) "
        "to (21) belong. Both are the best that a search found, and exact for R's minimum time: no method proves "
        "the global optimum of the others.",
        "Examples 4 to 6 are the PID loops (28) to (30) with the gains (32) to (34) over 10 s. The paper's + k_D θ̇ is "
        "unstable as printed; − k_D θ̇ is used. The arrival is the last time that joint 1's error enters 0.005 rad, "
        "unless the run has another rule.",
        "The payload is read in two ways. At the tip (tip): a point mass at the end of the last link, which is the "
        "physics. m → m + M (mM): the last link's mass grows while its centre of mass and inertia stay: the "
        "paper's PID times match this reading, although its text says that they change.",
        "Equation (7) is wrong as printed: its D is not symmetric and energy is not conserved. The RRR arm is computed "
        "by its mechanics, and its PID loop also by (7) as printed, as a labelled variant.",
    )
    grams = f"{len(PAYLOADS)} payloads of Table 2; figures, replays and statements show {1000 * payload:g} g."
    return join([element("ul", *(element("li", typeset(item)) for item in items)), element("p", grams)])


def _note_of_times(payload: float) -> Html:
    grams = f"M = {1000 * payload:g} g. "
    return element("p", grams, element("span", "The paper’s numbers", class_="said"), " next to ours.")


def _verdicts() -> Html:
    within = f"within a unit of the last printed digit, PID times within {ARRIVAL_TOLERANCE:g} s"
    return element(
        "p",
        element("span", "Coloured numbers are the paper’s. ", class_="said"),
        element("span", "✓", class_="mark good"),
        f" reproduced by a reading: {within}. ",
        element("span", "≈", class_="mark near"),
        f" is within {100 * CLOSE:g} % of one, which is no proof of the same computation: neighbouring payloads "
        "differ by as much. Unmarked: reproduced by no reading. Ours that match are bold. In words:",
        *(join([" ", tag(verdict)]) for verdict in VERDICTS),
        ".",
    )


def _picture(picture: Picture) -> Html:
    figure = picture.figure
    drawing = inline_svg(picture.svg, f"figure{figure.number}", figure.title, _SVG_COLORS)
    return element(
        "figure",
        element("div", drawing, class_="scroll bare", tabindex=0),
        element("figcaption", typeset(figure.caption)),
    )


def _stage(payload: float) -> Html:
    text = (
        f"The motions of the figures, M = {1000 * payload:g} g at the tip, played from the same numbers. Drag to turn, "
        "space to pause."
    )
    stage = element(
        "div", "The replay starts when it is in view; it needs scripts and WebGL.", id="stage", class_="stage"
    )
    note = element("p", "Replays cannot be printed.", class_="paper-only")
    return join([element("p", text, class_="screen"), element("div", id="tabs", class_="tabs"), stage, note])


def _statements(outcomes: Sequence[Outcome], payload: float) -> Html:
    parts = []
    for arm in PLANAR_ARMS:
        items = statements(arm, outcomes, payload)
        heading = element("h3", f"Section {SECTIONS[arm]}: {arm.upper()}")
        summary = join(
            (join([f"{item.item} {item.topic.lower()} ", tag(item.verdict)]) for item in items), between=" &nbsp; "
        )
        checks = sum(len(item.checks) for item in items)
        text = element("summary", f"The {checks} claims, each with our result")
        parts += [heading, element("p", summary), element("details", text, statement_table(items))]
    return join(parts)


def _approaches(outcomes: Sequence[Outcome]) -> Html:
    return join(
        [
            grid_table(first_approach_grid(), folded=True),
            element("h3", "The second approach: direct and indirect"),
            element(
                "p",
                "Direct: collocation of the optimal-control problem. Indirect: the canonical system (18), corrected, "
                "as a boundary-value problem by three-stage Lobatto IIIA, for minimum time ending in multiple "
                "shooting on the switching times.",
            ),
            two_methods(outcomes),
        ]
    )


def _replays(outcomes: Iterable[Outcome], payload: float) -> dict[str, object]:
    """Data of the page's script: template, viewer and motions, compressed and as base64; the first one to show."""
    found = by_case(outcome for outcome in outcomes if outcome.trajectory is not None)
    motions = []
    for one in EXAMPLES:
        kinds: tuple[Kind, ...] = ("pid",) if one.kind == "pid" else ("minimum_time", "time_energy")
        cases = [Case(one.number, one.arm, kind, payload) for kind in kinds]
        moves = [(case, motion) for case in cases if case in found and (motion := found[case].trajectory) is not None]
        if moves:
            what = "PID" if one.kind == "pid" else "time optimal"
            fields = page_fields(replay_of(cases[0].robot(), [motion for _, motion in moves]))
            label = f"Example {one.number}: {one.arm.upper()}, {what}"
            motions.append({"label": label, "fields": _packed(json.dumps(fields))})
    return {
        "template": _packed(page_template(evaluates=True)),
        "viewer": _packed(viewer_script()),
        "motions": motions,
        "first": min(1, max(len(motions) - 1, 0)),
    }


_packed = lru_cache(maxsize=16)(packed_text)  # the page is written twice with the same replays
