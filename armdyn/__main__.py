"""`python -m armdyn` is the command `armdyn`."""

from armdyn.cli import main

main()
