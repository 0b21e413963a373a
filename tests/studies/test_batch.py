"""How many cases a batch has."""

from armdyn.studies.dask_cluster import MOST, TARGET, BatchSize, target

MANY = 10**6


def learned(each, rounds=12):
    size, given = BatchSize(), []
    for _ in range(rounds):
        given.append(size.cases(MANY, 2))
        size.add(given[-1], given[-1] * each)
    return given


def test_it_begins_with_one_and_doubles_until_a_batch_takes_as_long_as_wanted():
    # 1, 2, 4 … up to as many cases of a hundredth as the target has.
    assert learned(0.01) == [1, 2, 4, 8, 16, 32, 64, *[round(TARGET / 0.01)] * 5]
    assert set(learned(5.0)) == {1} and learned(0.0)[-1] == MOST


def test_cases_that_become_longer_have_smaller_batches():
    size = BatchSize()
    for _ in range(10):
        size.add(size.cases(MANY, 2), 0.0001)
    for _ in range(20):
        size.add(1, 0.5)
    assert size.cases(MANY, 2) == 2


def test_a_thousand_workers_have_longer_batches_for_one_client_to_keep_up():
    size = BatchSize()
    for _ in range(10):
        size.add(size.cases(MANY, 1000), 0.1 * size.cases(MANY, 1000))
    assert target(2) == TARGET and target(1000) == 10.0 and size.cases(MANY, 1000) == 100


def test_the_last_cases_are_shared_out():
    size = BatchSize()
    for _ in range(10):
        size.add(size.cases(MANY, 2), 1e-6)
    left, given = 100, []
    while left:
        given.append(size.cases(left, 5))
        left -= given[-1]
    assert given[0] == 10 and given == sorted(given, reverse=True) and given[-1] == 1
