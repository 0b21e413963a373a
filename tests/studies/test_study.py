"""Which cases a study has."""

import numpy as np
import pytest

from armdyn.errors import ProblemError
from armdyn.studies.study import Axis, Study
from toys import Square

RANGE = Axis(name="a", low=1.0, high=3.0, count=3)
WORDS = Axis(name="arm", values=("r", "rr"))


def study(*axes, **options):
    return Study(task=Square(), axes=axes, **options)


def test_a_grid_has_all_of_each_with_all_of_the_others_the_last_fastest():
    grid = study(RANGE, WORDS)
    assert [tuple(grid.parameters(k).values()) for k in range(len(grid))] == [
        (1.0, "r"), (1.0, "rr"), (2.0, "r"), (2.0, "rr"), (3.0, "r"), (3.0, "rr")
    ]  # fmt: skip


def test_a_log_scale_has_even_ratios_and_numbers_are_short():
    axis = Axis(name="a", low=0.1, high=1000.0, count=5, scale="log")
    assert [axis.value(place) for place in axis.places()] == [0.1, 1.0, 10.0, 100.0, 1000.0]
    assert Axis(name="a", low=0.05, high=0.2, count=6).value(0.2) == 0.08


def test_random_cases_are_those_of_the_seed_and_a_greater_count_begins_with_them():
    axes = (RANGE, Axis(name="b", low=-1.0, high=1.0))
    few, more, other = (study(*axes, method="random", count=n, seed=s) for n, s in ((10, 1), (20, 1), (10, 2)))
    assert np.array_equal(few.points, more.points[:10])
    assert not np.any(few.points == other.points)


def test_a_latin_hypercube_has_one_case_in_each_part_of_each_range():
    cube = study(RANGE, Axis(name="b", low=0.1, high=10.0, scale="log"), method="latin-hypercube", count=50, seed=4)
    assert np.array_equal(np.sort(np.floor(50 * cube.points), axis=0), np.tile(np.arange(50.0)[:, None], 2))
    again = study(*cube.axes, method="latin-hypercube", count=50, seed=4)
    assert again.description() == cube.description()
    assert again.description() != study(*cube.axes, method="latin-hypercube", count=50, seed=5).description()


def test_words_each_have_their_share_of_a_draw():
    drawn = study(WORDS, RANGE, method="latin-hypercube", count=50)
    assert sum(drawn.parameters(k)["arm"] == "rr" for k in range(50)) == 25


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: study(), "nothing varies"),
        (lambda: study(RANGE, RANGE), "each once"),
        (lambda: study(RANGE, count=3), "leave count out"),
        (lambda: study(Axis(name="a", low=0.0, high=1.0)), "a range without count"),
        (lambda: study(RANGE, method="random"), "count is 0; a study has 1 to 1000000 cases"),
        (lambda: study(*(Axis(name=f"a{i}", low=0.0, high=1.0, count=2000) for i in range(9))), "a study has 1 to"),
        (lambda: study(RANGE, method="sobol"), "method is 'sobol'"),
        (lambda: Axis(name="a", low=1.0, high=1.0, count=2), "it must go up"),
        (lambda: Axis(name="a", low=0.0, high=1.0, count=2, scale="log"), "begins above 0"),
        (lambda: Axis(name="a", low=0.0, high=float("inf"), count=2), "a: to is inf"),
        (lambda: Axis(name="a", values=(1.0, 2.0, 1.0)), "a value twice"),
    ],
)
def test_a_wrong_study_is_refused(make, words):
    with pytest.raises(ProblemError, match=words):
        make()
