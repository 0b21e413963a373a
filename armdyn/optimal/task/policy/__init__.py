"""What depends on the kind of problem, and the tuned numbers, each once: with unit, reason, and what it was chosen on."""

from armdyn.optimal.task.policy.policy import Policy

__all__ = ["Policy"]
