"""Messages that browsers send to the studio: those that no page of ours sends are dropped."""

import math
from collections.abc import Awaitable, Callable
from typing import Any

import viser

_LARGEST = 1e6
"""Largest number that a page sends, in its widgets' units or as a pose [m]."""


def guard(server: viser.ViserServer) -> None:
    """Have a server drop malformed messages: it would keep their values, and widgets and gizmos would raise."""
    connection: Any = server._websock_server
    plain: Callable[[Any, Any], Awaitable[None]] = connection._handle_incoming_message

    async def checked(client: Any, message: Any) -> None:
        if well_formed(message, server.gui._gui_input_handle_from_uuid):
            await plain(client, message)

    connection._handle_incoming_message = checked


def well_formed(message: Any, widgets: dict[str, Any]) -> bool:
    """Whether a message is one that a page sends.

    Args:
        message: of viser: an object with its fields.
        widgets: of the page, by the name in messages.
    """
    kind = type(message).__name__
    if kind == "GuiUpdateMessage":
        uuid, updates = message.uuid, message.updates
        known = isinstance(uuid, str) and uuid in widgets and isinstance(updates, dict) and set(updates) == {"value"}
        return known and _fits(updates["value"], widgets[uuid])
    if kind.startswith("TransformControls") and hasattr(message, "wxyz"):
        return _numbers(message.wxyz, 4) and _numbers(message.position, 3) and any(message.wxyz)
    return True


def _fits(value: Any, widget: Any) -> bool:
    """Whether a widget can have a value."""
    before, options = widget.value, getattr(widget, "options", None)
    if isinstance(before, tuple):
        return _numbers(value, len(before))
    if isinstance(before, bool | str):
        return type(value) is type(before) and (options is None or value in options)
    low, high = getattr(widget, "min", None), getattr(widget, "max", None)
    return _numbers([value], 1) and (low is None or low <= value) and (high is None or value <= high)


def _numbers(values: Any, count: int) -> bool:
    """Whether values are so many finite numbers of a page's size."""
    right = isinstance(values, list | tuple) and len(values) == count
    return right and all(type(x) in (int, float) and math.isfinite(x) and abs(x) <= _LARGEST for x in values)
