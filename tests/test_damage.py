"""A sample of the damaged files of scripts/fuzz_files.py."""

import pytest

from damage import damaged_json, damaged_trajectories, fuzz_json, fuzz_trajectories


@pytest.mark.parametrize("fuzz", [pytest.param(fuzz_trajectories, marks=pytest.mark.slow), fuzz_json])
def test_damaged_files_are_read_or_refused_by_name(fuzz):
    ends = fuzz(100, 0)
    assert ends.total() == 100 and len(ends) > 10
    assert not [end for end in ends if end.startswith("BAD")]


@pytest.mark.parametrize("damaged", [damaged_trajectories, damaged_json])
def test_the_same_number_is_the_same_file(damaged):
    every = list(damaged(10, 0))
    again = [file for number in range(10) for file in damaged(1, number)]
    assert [name for name, _ in every] == [name for name, _ in again]
    assert len({data for _, data in every}) > 5
