"""What is said of a solution on a terminal."""

from dataclasses import replace

import numpy as np

import armdyn as ad
from armdyn.cli.motion.words import solution_words, title_words
from armdyn.optimal.proof.certificate import Certificate
from problems import solved


def failure(**changes):
    nothing = Certificate(np.inf, np.inf, np.inf, remark="no motion was found")
    parts = {"phases": None, "arcs": (), "certificate": nothing, "moves": False, "message": "no motion was found"}
    return replace(solved("r"), **(parts | {"success": False, "status": ad.Status.INFEASIBLE} | changes))


def test_a_failure_pretends_no_digits():
    words = solution_words(failure(), wrap=False)
    assert "duration" not in words and "replay" not in words
    assert not any("inf" in said.split() for said in words.values())
    assert title_words(failure()) == "infeasible, no motion to the goal"


def test_a_success_has_all_of_them():
    solution = solved("r")
    assert solution_words(solution, wrap=False)["duration"] == f"{solution.duration:.9f} s"
    assert title_words(solution) == f"minimum time {solution.duration:.4f} s, certified"


def test_the_best_so_far_is_called_so():
    best = failure(moves=True, status=ad.Status.TIME_LIMIT, certificate=solved("r").certificate)
    assert title_words(best) == f"time limit, best so far {best.duration:.4f} s"
    assert "duration" not in solution_words(best, wrap=False)
