import pytest

from armdyn.optimal.task.scheme import Scheme


def test_unknown_names_are_refused():
    with pytest.raises(ValueError, match="euler"):
        Scheme(method="euler")
