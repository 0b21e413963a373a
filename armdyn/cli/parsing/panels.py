"""The panels of help, in their order."""

TASK, ROBOT, LIMITS, SCENE, SOLVER, OUTPUT = "Task", "Robot", "Limits", "Scene", "Solver", "Output"

_LAST = (SOLVER, OUTPUT)
_FIRST = (TASK, ROBOT, LIMITS, SCENE)


def place(panel: str) -> int:
    """Sort key of a panel: the task first, the output last, the panels of a single command between."""
    if panel in _FIRST:
        return _FIRST.index(panel)
    return len(_FIRST) + 1 + _LAST.index(panel) if panel in _LAST else len(_FIRST)
