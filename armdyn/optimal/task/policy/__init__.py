"""What depends on the kind of problem, and the tuned numbers, each once, with its unit, reason and cases."""

from armdyn.optimal.task.policy.policy import Policy

__all__ = ["Policy"]
