import pytest

import armdyn as ad
from armdyn.errors import ProblemError


def test_bad_options():
    with pytest.raises(ProblemError, match="intervals is 0"):
        ad.MinimumTimeOptions(intervals=0)
    with pytest.raises(ProblemError, match="time_limit"):
        ad.MinimumTimeOptions(time_limit=-1.0)
