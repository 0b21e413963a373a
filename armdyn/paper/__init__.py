"""The paper, reproduced: its printed numbers and equations, our results, its claims, tables, pages.

The rooms in the order of the data; none imports one below it:

- `closed_form`: D, C and g of its arms, derived by hand.
- `indirect`: its second approach, Pontryagin's canonical system as equations.
- `printed`: its examples, equations as printed, gains, published numbers.
- `outcomes`: one case solved or simulated, and kept on disk. Nothing is drawn there.
- `claims`: the paper's statements in words, measured; its first approach; whether a goal can be held.
- `tables`: Tables 3 to 7, published against computed.
- `page`: figures, each example's folder, and the page that shows it all.

`plan` says which cases there are to solve, and `reproduce` goes through all rooms.
"""

from armdyn.lazy import facade

__getattr__, __dir__, __all__ = facade(__name__, __file__)
