"""Outcomes are computed without drawing libraries."""

import json
import subprocess
import sys

import pytest

COMPUTE = """
import json, sys
from armdyn.paper.outcomes.case import Case
from armdyn.paper.outcomes.run import run_case
from armdyn.paper import reproduce, tables
for case in ((4, "r", "pid", 0.1006), (1, "r", "minimum_time", 0.1006)):
    assert run_case(Case(*case)).success
print(json.dumps([name for name in sys.modules if name.split(".")[0] in ("matplotlib", "meshcat")
                  or name.startswith("armdyn.show.") or name.startswith("armdyn.paper.page")]))
"""


@pytest.mark.slow
def test_cases_are_run_without_plots():
    done = subprocess.run([sys.executable, "-c", COMPUTE], capture_output=True, text=True, check=True)
    assert not json.loads(done.stdout)
