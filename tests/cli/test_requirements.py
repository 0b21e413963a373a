"""`--require`: its syntax, refused texts, and the check of a motion."""

from dataclasses import replace

import pytest

from armdyn.cli.motion.require import missing_of, requirements_of
from armdyn.errors import ProblemError
from armdyn.optimal.answer.words import standing
from problems import solved


def missing(solution, *texts):
    return missing_of(requirements_of(texts), solution.usable, standing(solution))


def gap(part, solution=None):
    """A solution whose lower bound is so far below it."""
    solution = solution or solved("r")
    return replace(
        solution, certificate=solution.certificate.bounded(solution.duration / (1 + part), solution.duration)
    )


def no_extremal(solution):
    return replace(solution, certificate=replace(solution.certificate, hamiltonian_spread=1.0))


@pytest.mark.parametrize(
    ("text", "most"),
    [("gap:0.5%", 0.005), ("gap:0.005", 0.005), (" gap: 2 % ", 0.02), ("gap:0", 0.0), ("gap:1e-4", 1e-4)],
)
def test_a_gap_is_a_part_or_per_cent(text, most):
    assert requirements_of([text]) == {text.strip(): pytest.approx(most, rel=1e-15)}


@pytest.mark.parametrize(
    "text", ["", "gap", "gap:", "gap:%", "gap:much", "gap:-1%", "gap:nan", "gap:inf", "gap:5", "gap=0.5%", "Certified",
             "certified:1", "optimal", "certified,extremal"],
)  # fmt: skip
def test_unknown_requirements_are_refused(text):
    with pytest.raises(ProblemError, match="--require"):
        requirements_of([text])


def test_met_conditions_are_not_missing():
    assert missing(solved("r"), "certified", "extremal") == []
    assert missing(gap(4e-3), "gap:0.5%", "gap:0.004001") == []
    assert missing(gap(5e-4, no_extremal(solved("r"))), "certified") == []


def test_unmet_conditions_are_missing_with_their_reasons():
    plain = no_extremal(solved("r"))
    assert missing(plain, "certified") == ["certified is missing: the Hamiltonian strays from 0 by 1"]
    (line,) = missing(gap(5e-4, plain), "certified", "extremal")
    assert line.startswith("extremal is missing: not extremal: ")
    assert missing(gap(7e-3), "gap:0.5%") == ["gap:0.5% is missing: the gap is 0.7 %"]
    (line,) = missing(solved("r"), "gap:0.5%", "certified")
    assert line.startswith(
        "gap:0.5% is missing: no gap: no lower bound was computed: ad.lower_bound(problem) gives one"
    )


def test_a_gap_that_is_not_proven_is_none():
    beside = replace(solved("r"), certificate=replace(solved("r").certificate, goal_error=1e-5))
    (line,) = missing(gap(1e-5, beside), "gap:1%")
    assert "not proven" in line


def test_of_unusable_motions_all_is_missing():
    beside = replace(solved("r"), certificate=replace(solved("r").certificate, goal_error=0.1))
    assert missing(beside, "certified", "gap:1%") == [
        "certified is missing: the motion is not usable",
        "gap:1% is missing: the motion is not usable",
    ]
    assert missing(beside) == []
