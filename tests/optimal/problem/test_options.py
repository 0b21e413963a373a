"""Options of a user, and refused values."""

from dataclasses import fields

import pytest

import armdyn as ad
from armdyn.errors import ProblemError


@pytest.mark.parametrize(
    ("option", "message"),
    [
        ({"max_intervals": 0}, "max_intervals is 0"),
        ({"workers": 0}, "workers is 0"),
        ({"starts": -1}, "starts is -1"),
        ({"time_limit": -1.0}, "time_limit is -1.0; it must be positive"),
        ({"calm": float("nan")}, "calm"),
    ],
)
def test_bad_options(option, message):
    with pytest.raises(ProblemError, match=message):
        ad.MinimumTimeOptions(**option)


def test_every_option_is_documented():
    text = ad.MinimumTimeOptions.__doc__
    assert all(f"{field.name}:" in text for field in fields(ad.MinimumTimeOptions))
