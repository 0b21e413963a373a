"""What a notebook shows of robots, problems, solutions, motions and runs: `_repr_html_` of these leads here."""

from armdyn.show.notebook.cards import card as card
