"""The page: it holds it all, links nowhere, and in a browser the arm moves."""

import re
from dataclasses import replace

import pytest

from armdyn.studies.paper.outcomes.case import Case
from armdyn.studies.paper.page.page import write_page
from armdyn.studies.paper.page.page_tables import paper_table
from armdyn.studies.paper.tables.rows import all_rows
from show.browser import left_the_page, open_page
from studies.paper.computed import outcome, outcomes

SECTIONS = ["what", "glance", "tables", "figures", "replays", "statements", "approaches", "feasibility"]
READY = "window.armdynPage !== undefined"


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    folder = tmp_path_factory.mktemp("page")
    return folder, write_page(folder, outcomes(), all_rows(outcomes()))


def text_of(path):
    return path.read_text("utf-8")


def test_what_is_written(written):
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
    assert set(re.findall(r'<a href="([^"]*)"', page)) == {f"#{name}" for name in SECTIONS}
    ids = re.findall(r'\bid="([^"]+)"', page)
    assert len(ids) == len(set(ids))


def test_verdicts_are_in_words_with_their_reasons(written):
    folder, _ = written
    page = text_of(folder / "index.html")
    for verdict, color in (("reproduced", "good"), ("close", "near"), ("not reproduced", "bad")):
        assert f'<span class="tag {color}">{verdict}</span>' in page
    rows = [row for row in all_rows(outcomes()) if row.table == 4]
    (arrival,) = [r for r in rows if r.kind == "pid" and r.reading == "mM" and r.payload_kg == 0.1006]
    assert arrival.verdict == "reproduced"
    assert f"{arrival.published:.3f}" in page and f"{arrival.ours:.4f}" in page
    assert "max Re λ = -1.053 1/s" in page


@pytest.mark.slow
def test_it_is_read_in_a_browser_and_the_arm_moves(written):
    folder, _ = written
    with open_page(folder / "index.html", ready=READY) as (page, requests, errors):
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
        card = shown.locator("#card").inner_text()
        assert "minimum time" in card and "time" in card.split("minimum time")[1]
        assert not errors
        assert not left_the_page([url for url in requests if not url.startswith("about:")])


def test_it_follows_the_screen(written):
    folder, _ = written
    with open_page(folder / "index.html", width=390, height=844, ready=READY) as (page, _, errors):
        assert page.evaluate("document.documentElement.scrollWidth") == 390  # wide tables scroll by themselves
        light = page.evaluate("getComputedStyle(document.body).backgroundColor")
        page.emulate_media(color_scheme="dark")
        dark = page.evaluate("getComputedStyle(document.body).backgroundColor")
        assert light != dark
        ink = "getComputedStyle(document.querySelector('figure svg text, figure svg path[style*=ink]')).stroke"
        assert page.evaluate(ink) == "rgb(228, 233, 238)"  # the figures' axes follow
        page.emulate_media(media="print")
        assert page.locator("#stage").is_hidden() and page.locator("nav").is_hidden()
        assert not errors


@pytest.mark.slow
def test_strings_from_elsewhere_stay_text(tmp_path):
    evil = "</script><script>window.broken = 1</script><img src=x onerror='broken=1'>{{body}}"
    case = Case(4, "r", "pid", 0.1006)
    motion = replace(outcome(case).trajectory, name=evil)
    made = replace(outcome(case), trajectory=motion, message=evil)
    rows = [replace(row, reason=evil, setup=evil) for row in all_rows([made])]
    write_page(tmp_path, [made], rows)
    with open_page(tmp_path / "index.html", ready=READY) as (page, _, errors):
        page.locator("#stage").scroll_into_view_if_needed()
        page.wait_for_selector("#stage iframe", timeout=30_000)
        page.frames[1].wait_for_function("window.armdyn !== undefined", timeout=60_000)
        for frame in page.frames:
            assert frame.evaluate("window.broken") is None
        assert evil in page.locator("#tables").text_content()
        assert not errors


@pytest.mark.slow
def test_the_same_outcomes_give_the_same_page(written, tmp_path):
    folder, _ = written
    write_page(tmp_path, outcomes(), all_rows(outcomes()))
    assert text_of(folder / "index.html") == text_of(tmp_path / "index.html")


def test_what_was_not_computed_is_said(tmp_path):
    write_page(tmp_path, [], [])
    page = text_of(tmp_path / "index.html")
    assert page.count("Not computed.") > 5
    assert "<figure>" not in page


def test_table_7_is_told_by_robot_example_and_torque():
    page = paper_table(7, all_rows(outcomes()))
    assert page.count("<table") == 3  # time optimal, PID, reasons
    assert re.search(r'<td class="first">R</td><td class="line">4</td><td class="line">τ1</td>', page)
