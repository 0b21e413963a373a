"""The paper, reproduced: what it prints, what comes of it here, what it claims, tables, pages.

The rooms in the order of the data; none imports one below it:

- `closed_form`: D, C and g of its arms, derived by hand.
- `indirect`: its second approach, Pontryagin's canonical system as equations.
- `printed`: its examples, equations as printed, gains, published numbers.
- `outcomes`: one case solved or simulated, and kept on disk. Nothing is drawn there.
- `claims`: what the paper says in words, measured; its first approach; whether a goal can be held.
- `tables`: Tables 3 to 7, published beside ours.
- `page`: figures, each example's folder, and the page that shows it all.

`plan` says which cases there are to solve, and `reproduce` goes through all rooms.
"""

from typing import TYPE_CHECKING

from armdyn.lazy import facade

if TYPE_CHECKING:
    from armdyn.paper.closed_form import PlanarArm
    from armdyn.paper.indirect.law import MINIMUM, TorqueLaw
    from armdyn.paper.indirect.solution import Comparison, IndirectOptions, IndirectSolution, compare_with_direct
    from armdyn.paper.indirect.solve_indirect import solve_indirect
    from armdyn.paper.printed.examples import EXAMPLES, PAYLOAD, PAYLOADS, Example, Kind, example
    from armdyn.paper.printed.loop import GAINS
else:
    __getattr__, __dir__ = facade(
        __name__,
        {
            "closed_form": "PlanarArm",
            "indirect.law": "MINIMUM TorqueLaw",
            "indirect.solution": "Comparison IndirectOptions IndirectSolution compare_with_direct",
            "indirect.solve_indirect": "solve_indirect",
            "printed.examples": "EXAMPLES PAYLOAD PAYLOADS Example Kind example",
            "printed.loop": "GAINS",
        },
    )

__all__ = [
    "EXAMPLES",
    "GAINS",
    "MINIMUM",
    "PAYLOAD",
    "PAYLOADS",
    "Comparison",
    "Example",
    "IndirectOptions",
    "IndirectSolution",
    "Kind",
    "PlanarArm",
    "TorqueLaw",
    "compare_with_direct",
    "example",
    "solve_indirect",
]
