"""How a worker goes through some cases."""

import numpy as np

from armdyn.studies.executor import StudyCase, run_in_turn
from toys import Square


def cases(*numbers, **others):
    return [StudyCase(k=k, settings={"x": float(k)}, **others) for k in numbers]


def test_each_case_begins_with_the_nearest_motion_that_is_there():
    given = {"guess": np.array([9.0]).tobytes(), "begun_from": 9}
    first, second, third = (
        StudyCase(k=3, settings={"x": 3.0}, near=(2, 9), **given),
        StudyCase(k=4, settings={"x": 4.0}, near=(3, 9), **given),  # the first is nearer than the given one
        StudyCase(k=8, settings={"x": 8.0}, near=(9, 4), **given),  # here it is not
    )
    done = list(run_in_turn(Square(neighbours="add"), [first, second, third], 10.0))
    assert [one.begun_from for one in done] == [9, 3, 9]
    assert [one.result.facts["begun"] for one in done] == [9.0, 3.0, 9.0]


def test_cases_not_begun_in_time_are_left_out_except_the_first():
    task = Square(seconds=0.05)
    assert [one.k for one in run_in_turn(task, cases(1, 2, 3), 0.0)] == [1]
    done = list(run_in_turn(task, cases(*range(100)), 0.12))
    assert [one.k for one in done] == list(range(len(done))) and 1 <= len(done) <= 3  # 0.05 s each at least
