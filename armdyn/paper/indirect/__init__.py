"""The paper's second approach: Pontryagin's canonical system as equations."""

from armdyn.paper.indirect.law import MINIMUM, LawSymbols, TorqueLaw

__all__ = ["MINIMUM", "LawSymbols", "TorqueLaw"]
