"""What a motion looks like: figures and replays.

`from armdyn.show import plots, replay` loads matplotlib and meshcat; nothing else in armdyn does.
"""
