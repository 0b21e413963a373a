"""The page: it holds it all, links nowhere, and in a browser the arm moves."""

import html
import re
from dataclasses import replace

import pytest

from armdyn.paper.outcomes.case import Case
from armdyn.paper.page.comparisons import comparison
from armdyn.paper.page.mathematics import formula
from armdyn.paper.page.page import write_page
from armdyn.paper.tables.rows import all_rows
from paper.computed import outcome, outcomes
from show.browser import left_the_page, open_page

SECTIONS = [
    "evidence", "glance", "tables", "figures", "replays", "statements", "errata", "approaches", "feasibility", "what",
]  # fmt: skip
READY = "window.armdynPage !== undefined"

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    folder = tmp_path_factory.mktemp("page")
    return folder, write_page(folder, outcomes(), all_rows(outcomes()))


@pytest.fixture(scope="module")
def opened(chromium, written):
    """The page on a phone's screen; tests may give it another, and other media."""
    folder, _ = written
    with open_page(chromium, folder / "index.html", width=390, height=844, ready=READY) as (page, requests, errors):
        yield page, requests, errors


def text_of(path):
    return path.read_text("utf-8")


def test_written_files(written):
    folder, files = written
    names = [str(path.relative_to(folder)) for path in files]
    assert names == [f"figures/figure{k}.{kind}" for k in (2, 3, 5, 7) for kind in ("pdf", "png")] + ["index.html"]
    assert all(path.is_file() for path in files)
    assert (folder / "index.html").stat().st_size < 6e6


def test_the_page_holds_it_all_and_links_nowhere(written):
    folder, _ = written
    page = text_of(folder / "index.html")
    assert re.findall(r'<section id="(\w+)"', page) == SECTIONS
    for number in range(3, 8):
        assert f'id="table{number}"' in page
    assert page.count("<figure>") == 4 == page.count('<svg role="img"')
    assert not re.findall(r"(?:https?|wss?|ftp)://", page)
    assert not re.findall(r"<(?:link|img|iframe)\b|<script[^>]+src", page)
    ids = re.findall(r'\bid="([^"]+)"', page)
    assert len(ids) == len(set(ids))
    links = set(re.findall(r'<a href="([^"]*)"', page))
    assert {f"#{name}" for name in SECTIONS} <= links <= {f"#{name}" for name in ids}


def test_verdicts_are_in_words_with_their_reasons(written):
    folder, _ = written
    page = text_of(folder / "index.html")
    for verdict, color in (("reproduced", "good"), ("close", "near"), ("not reproduced", "bad")):
        assert f'<span class="tag {color}">{verdict}</span>' in page
    rows = [row for row in all_rows(outcomes()) if row.table == 4]
    (arrival,) = [r for r in rows if r.kind == "pid" and r.reading == "mM" and r.payload_kg == 0.1006]
    assert arrival.verdict == "reproduced"
    assert f"{arrival.published:.3f}" in page and f"{arrival.ours:.4f}" in page
    reasons = re.sub(r"<[^>]+>", "", page)
    assert "maxReλ = -1.053 1/s" in html.unescape(reasons)


def test_failures_are_ascribed_to_the_papers_numbers_and_not_to_ours(written):
    folder, _ = written
    page = text_of(folder / "index.html")
    assert "<h1>The paper’s numbers do not follow from its own data</h1>" in page
    # Outside the folded parts no single number is called not reproduced.
    open_ = re.sub(r"<details>.*?</details>", "", page, flags=re.DOTALL)
    assert open_.count('class="tag bad">not reproduced</span>') == 1  # the legend
    cells = re.findall(r'<td class="([^"]*)"[^>]*>|<td [^>]*class="([^"]*)"[^>]*>', open_)
    coloured = [c.split() for pair in cells for c in pair if {"good", "near", "bad"} & set(c.split())]
    assert coloured and all("said" in kinds or kinds == ["bad"] for kinds in coloured)  # ✗ of holding torques


def test_it_is_read_in_a_browser_and_the_arm_moves(chromium, written):
    folder, _ = written
    with open_page(chromium, folder / "index.html", ready=READY) as (page, requests, errors):
        assert page.locator("#tabs button").all_inner_texts() == [
            "Example 1: R, time optimal",
            "Example 4: R, PID",
            "Example 5: RR, PID",
            "Example 6: RRR, PID",
        ]
        assert page.locator("iframe").count() == 0  # no viewer before it is looked at
        page.locator("#stage").scroll_into_view_if_needed()
        page.wait_for_selector("#stage iframe", timeout=30_000)
        shown = page.frames[1]
        shown.wait_for_function("window.armdyn && armdyn.time > 0.01", timeout=60_000)
        before = shown.evaluate("armdyn.seek(0), armdyn.linkPosition('tip')")
        after = shown.evaluate("armdyn.seek(armdyn.duration), armdyn.linkPosition('tip')")
        assert max(abs(a - b) for a, b in zip(before, after, strict=True)) > 0.2
        page.locator("#tabs button").first.click()
        page.wait_for_function("document.querySelector('#stage iframe').title.startsWith('Example 1')", timeout=30_000)
        shown = page.frames[-1]
        shown.wait_for_function("window.armdyn !== undefined", timeout=60_000)
        runs = " ".join(shown.locator(".run").all_inner_texts())
        assert "minimum time" in runs and "time" in runs.split("minimum time")[1]
        assert not errors
        assert not left_the_page([url for url in requests if not url.startswith("about:")])


def test_it_follows_the_screen(opened):
    page, _, errors = opened
    assert page.evaluate("document.documentElement.scrollWidth") == 390  # wide tables scroll by themselves
    assert page.evaluate("[...document.querySelectorAll('nav a')].every(a => a.getBoundingClientRect().right <= 390)")
    light = page.evaluate("getComputedStyle(document.body).backgroundColor")
    page.emulate_media(color_scheme="dark")
    dark = page.evaluate("getComputedStyle(document.body).backgroundColor")
    assert light != dark
    ink = "getComputedStyle(document.querySelector('figure svg text, figure svg path[style*=ink]')).stroke"
    assert page.evaluate(ink) == "rgb(228, 233, 238)"  # the figures' axes follow
    page.emulate_media(media="print")
    assert page.locator("#stage").is_hidden() and page.locator("nav").is_hidden()
    page.emulate_media(media="screen", color_scheme="light")
    assert not errors


def test_wide_tables_say_that_they_scroll(opened):
    page, requests, errors = opened
    page.wait_for_function("document.querySelector('#tables .sideways:not([hidden])') !== null", timeout=10_000)
    hints = """() => [...document.querySelectorAll('.scroll')].filter(one => one.checkVisibility()).map(one =>
        [one.scrollWidth > one.clientWidth + 4, !one.previousElementSibling.hidden, one.matches('.more')])"""
    measured = page.evaluate(hints)
    assert any(wide for wide, _, _ in measured) and all(wide == said == more for wide, said, more in measured)
    page.evaluate("document.querySelector('#tables .scroll').scrollLeft = 10000")
    page.wait_for_function("!document.querySelector('#tables .scroll').classList.contains('more')", timeout=10_000)
    page.evaluate("document.querySelectorAll('details').forEach(one => { one.open = true; })")
    assert page.evaluate("document.documentElement.scrollWidth") == 390
    assert not errors and not left_the_page(requests)


def test_mathematics_is_set_by_the_browser(opened):
    page, requests, errors = opened
    # As mathematics a subscript stands lower than its base, and a fraction's parts above each other.
    low = """() => { const [base, sub] = document.querySelector('#errata msub').children;
        return sub.getBoundingClientRect().bottom - base.getBoundingClientRect().bottom; }"""
    assert page.evaluate(low) > 0
    over = """() => { const [top, bottom] = document.querySelector('#errata mfrac').children;
        return bottom.getBoundingClientRect().top - top.getBoundingClientRect().top; }"""
    assert page.evaluate(over) > 5
    assert page.evaluate("document.querySelector('#errata math').namespaceURI.endsWith('MathML')")
    assert not errors and not left_the_page(requests)


def test_strings_from_elsewhere_stay_text(chromium, tmp_path):
    evil = "</script><script>window.broken = 1</script><img src=x onerror='broken=1'>{{body}}"
    case = Case(4, "r", "pid", 0.1006)
    motion = replace(outcome(case).trajectory, name=evil)
    made = replace(outcome(case), trajectory=motion, message=evil)
    rows = [replace(row, reason=evil, setup=evil) for row in all_rows([made])]
    write_page(tmp_path, [made], rows)
    with open_page(chromium, tmp_path / "index.html", ready=READY) as (page, _, errors):
        page.locator("#stage").scroll_into_view_if_needed()
        page.wait_for_selector("#stage iframe", timeout=30_000)
        page.frames[1].wait_for_function("window.armdyn !== undefined", timeout=60_000)
        for frame in page.frames:
            assert frame.evaluate("window.broken") is None
        assert evil in page.locator("#tables").text_content()
        assert not errors


def test_the_same_outcomes_give_the_same_page(written, tmp_path, monkeypatch):
    monkeypatch.setattr("armdyn.paper.page.figures.save_figure", lambda figure, path: path)  # pdf and png are not in it
    folder, _ = written
    write_page(tmp_path, outcomes(), all_rows(outcomes()))
    assert text_of(folder / "index.html") == text_of(tmp_path / "index.html")


def test_missing_outcomes_are_reported(tmp_path):
    write_page(tmp_path, [], [])
    page = text_of(tmp_path / "index.html")
    assert page.count("Not computed.") > 5
    assert "<figure>" not in page
    assert "<h1>The paper, computed again</h1>" in page  # nothing compared, nothing claimed
    assert "numbers do not follow" not in page


def test_table_7_is_keyed_by_robot_example_and_torque():
    page = comparison(7, all_rows(outcomes()))
    assert page.count("<table") == 3  # time optimal, PID, reasons
    tau = re.escape(formula(r"\tau_1"))
    assert re.search(rf'<td class="first">R</td><td class="line">4</td><td class="line">{tau}</td>', page)
