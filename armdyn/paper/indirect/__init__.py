"""The paper's second approach: Pontryagin's canonical system as equations."""

from armdyn.paper.indirect.law import MINIMUM, Law, LawSymbols

__all__ = ["MINIMUM", "Law", "LawSymbols"]
