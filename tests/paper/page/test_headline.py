"""The page's headline is the result of the comparison, of computed cases only."""

import html
import re
from dataclasses import replace

import pytest

from armdyn.paper.outcomes.case import Case
from armdyn.paper.page.comparisons import comparison
from armdyn.paper.page.headline import evidence, headline, lead
from armdyn.paper.page.mathematics import typeset
from armdyn.paper.reproduce import Reproduced
from armdyn.paper.tables.rows import all_rows
from armdyn.paper.tables.standing import standings
from paper.computed import outcome, outcomes


def words(markup):
    return html.unescape(re.sub(r"<[^>]+>", " ", markup)).replace("\u00a0", " ")


@pytest.fixture(scope="module")
def rows():
    return all_rows(outcomes())


def test_the_counts_are_those_of_the_rows(rows):
    found = list(standings(rows).values())
    printed = [int(n) for n in re.findall(r"<b>(\d+)</b>", lead(rows, outcomes()))]
    assert printed == [found.count("reproduced"), found.count("close"), found.count("not reproduced")]
    assert f"Of {len(found)} numbers" in lead(rows, outcomes())


def test_the_headline_follows_the_comparison(rows):
    assert headline(rows) == "The paper’s numbers do not follow from its own data"
    assert headline([row for row in rows if row.verdict == "reproduced"]) == "The paper, computed again"
    assert headline([]) == "The paper, computed again"


def test_certified_optima_and_the_second_method_are_counted(rows):
    optima = [one for one in outcomes() if one.case.kind != "pid"]
    printed = words(lead(rows, outcomes()))
    assert f"{sum(one.facts['certified'] for one in optima)} of {len(optima)} optima are certified" in printed
    doubted = [replace(one, facts={**one.facts, "certified": False}) for one in optima]
    assert f"0 of {len(optima)} optima are certified" in words(lead(rows, doubted))


def test_minimum_times_are_evidence_only_where_ours_are_shorter(rows):
    assert "are no minimum" in evidence(rows, outcomes())
    (light,) = [r for r in rows if r.kind == "minimum_time" and r.payload_kg == 0.1006 and r.table == 4]
    (heavy,) = [r for r in rows if r.kind == "minimum_time" and r.payload_kg == 1.0 and r.table == 4]
    low, high = heavy.published / heavy.ours, light.published / light.ours
    assert f"{low:.2f} to {high:.2f} times (R)" in words(evidence(rows, outcomes()))
    slower = [replace(row, ours=2 * row.published) if row.kind == "minimum_time" else row for row in rows]
    assert "are no minimum" not in evidence(slower, outcomes())


def test_an_unstable_loop_is_evidence_with_its_eigenvalue(rows):
    unstable = outcome(Case(6, "rrr", "pid", 0.1006))
    printed = " ".join(words(evidence(rows, outcomes())).split())
    assert f"with 1 of 1 payloads: max Re λ is {unstable.facts['max_real_eigenvalue']:+.2f} 1/s" in printed
    damped = replace(unstable, facts={**unstable.facts, "max_real_eigenvalue": -1.0})
    assert "no settling time" not in evidence(rows, [damped])


def test_the_payloads_that_can_be_held_are_said(rows):
    printed = words(evidence(rows, outcomes()))
    assert "more than 2 of the 3 arms can hold" in printed
    assert "1.086 kg (R), 0.466 kg (RR), 0.237 kg (RRR)" in printed  # as docs/paper.md and its tests


def test_the_number_of_reproduced_values_is_stated(rows):
    assert "of 3 within 0.01 s" in words(evidence(rows, outcomes()))
    assert "reproduced" not in words(evidence([], []))
    assert "The paper has no number for the computed cases." in words(lead([], outcomes()))
    assert Reproduced((), (), ()).message() == "the paper has no number for the computed cases"


def test_each_table_has_its_result(rows):
    table = words(comparison(4, rows))
    assert "With the payload at the tip the PID times differ by" in table
    assert "no PID loop arrives within 10 s" in words(comparison(6, rows))
    assert "Not computed." in comparison(5, [])


def test_a_table_has_every_number_of_its_rows(rows):
    for number in range(3, 8):
        table = comparison(number, rows)
        folded = table[table.index("<details>") :]
        for row in rows:
            if row.table == number and row.ours is not None:
                assert f'{row.ours:.4f}</td><td class="text">{typeset(row.reason)}</td>' in folded
