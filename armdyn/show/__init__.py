"""Figures, replays and reports of motions.

`from armdyn.show import plots, replay` loads matplotlib and meshcat; nothing else in armdyn does.
"""
