"""Untrusted YAML: bounded in size, depth and references; every scalar stays text."""

import os
from typing import Any

from armdyn.errors import ProblemError
from armdyn.files import read_bounded

MAX_BYTES = 8 * 2**20
"""A file that is larger is not read [bytes]: a mesh of 30,000 triangles in it, seconds of work."""
_DEPTH = 40
_MOST_NODES = 1_000_000
"""Scalars, lists and tables, one behind many references as often as it is referred to."""


def read_yaml(path: str | os.PathLike[str]) -> Any:
    """The content of a YAML file: dictionaries, lists and texts. Tags make no objects.

    Raises:
        FileError: the file cannot be read, or is too large.
        ProblemError: it is no YAML, too deep, or too much once its references are followed.
    """
    import yaml  # type: ignore[import-untyped]  # for scenes alone

    data, loader = read_bounded(path, MAX_BYTES), getattr(yaml, "CBaseLoader", yaml.BaseLoader)
    too_deep = f"{path}: lists and tables lie deeper than {_DEPTH}"
    try:
        depth = 0
        for count, event in enumerate(yaml.parse(data, loader)):  # first: composing is recursive, and takes memory
            if count > _MOST_NODES:
                raise ProblemError(f"{path}: more than {_MOST_NODES} values")
            depth += isinstance(event, yaml.CollectionStartEvent) - isinstance(event, yaml.CollectionEndEvent)
            if depth > _DEPTH:
                raise ProblemError(too_deep)
        documents = [one for one in yaml.load_all(data, loader) if one]  # texts, lists and dictionaries
    except (yaml.YAMLError, ValueError, RecursionError) as error:
        if isinstance(error, ProblemError):
            raise
        if "nesting depth" in str(error):  # PyYAML 6.0.4 reads ahead up to a limit of its own, of 1,000
            raise ProblemError(too_deep) from None
        raise ProblemError(f"{path}: not YAML ({' '.join(str(error).split())[:200]})") from None
    if len(documents) > 1:
        raise ProblemError(f"{path}: {len(documents)} documents; it must be one (ros2 topic echo --once)")
    content = documents[0] if documents else {}
    left, todo = _MOST_NODES, [(content, 0)]
    while todo:
        node, depth = todo.pop()
        inside = list(node.values()) if isinstance(node, dict) else node if isinstance(node, list) else ()
        left -= 1 + len(inside)
        if left < 0 or depth > _DEPTH:
            raise ProblemError(f"{path}: its references (*name) make more than {_MOST_NODES} values of it")
        todo += [(one, depth + 1) for one in inside if isinstance(one, dict | list)]
    return content
