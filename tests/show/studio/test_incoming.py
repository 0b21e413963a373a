"""Messages that no page of ours sends."""

from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from armdyn.show.studio.incoming import well_formed

WIDGETS = {
    "slider": SimpleNamespace(value=0.5, min=0.0, max=1.0),
    "number": SimpleNamespace(value=0.1, min=1e-3, max=None),
    "place": SimpleNamespace(value=(0.0, 0.0, 0.0)),
    "choice": SimpleNamespace(value="1/5", options=("1", "1/5")),
    "box": SimpleNamespace(value=False),
}
RIGHT = {"slider": (0, 1.0, 0.25), "number": (2, 0.5), "place": ([1, 2.0, 3],), "choice": ("1",), "box": (True,)}
JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=4) | st.sampled_from(["value", "1/5"]),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.sampled_from(["value", "max"]), inner),
)


@dataclass
class GuiUpdateMessage:
    uuid: Any
    updates: Any


@dataclass
class TransformControlsUpdateMessage:
    wxyz: Any
    position: Any


@pytest.mark.parametrize("name", WIDGETS)
def test_values_of_a_page_are_taken_and_others_dropped(name):
    for value in RIGHT[name]:
        assert well_formed(GuiUpdateMessage(name, {"value": value}), WIDGETS)
        assert not well_formed(GuiUpdateMessage(name, {"value": value, "max": 1}), WIDGETS)
        assert not well_formed(GuiUpdateMessage("other", {"value": value}), WIDGETS)
    for value in (None, "abc", float("nan"), float("inf"), 1e300, -1, [], [1, 2], ["a"] * 3, {}):
        assert not well_formed(GuiUpdateMessage(name, {"value": value}), WIDGETS)


@given(JSON | st.sampled_from(list(WIDGETS)), JSON)
def test_whatever_passes_has_the_type_of_its_widget(uuid, updates):
    if well_formed(GuiUpdateMessage(uuid, updates), WIDGETS):
        before, value = WIDGETS[uuid].value, updates["value"]
        assert isinstance(value, list if uuid == "place" else (int, float) if uuid != "choice" else str)
        assert not isinstance(before, tuple) or len(value) == len(before)


@given(JSON, JSON)
def test_poses_are_three_numbers_and_a_rotation(wxyz, position):
    assert well_formed(TransformControlsUpdateMessage([1, 0, 0, 0], [0.5, 0, 0]), {})
    assert not well_formed(TransformControlsUpdateMessage([0, 0, 0, 0], [0.5, 0, 0]), {})
    if well_formed(TransformControlsUpdateMessage(wxyz, position), {}):
        assert len(wxyz) == 4 and len(position) == 3 and any(wxyz)
