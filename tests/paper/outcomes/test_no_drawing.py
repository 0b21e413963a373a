"""Outcomes are computed without what draws them."""

import json
import subprocess
import sys

import pytest

COMPUTE = """
import json, sys
from armdyn.paper.outcomes.case import Case
from armdyn.paper.outcomes.run import run_case
from armdyn.paper import reproduce, tables
assert run_case(Case({case})).success
print(json.dumps([name for name in sys.modules if name.split(".")[0] in ("matplotlib", "meshcat")
                  or name.startswith("armdyn.show.") or name.startswith("armdyn.paper.page")]))
"""


@pytest.mark.slow
@pytest.mark.parametrize("case", ["4, 'r', 'pid', 0.1006", "1, 'r', 'minimum_time', 0.1006"])
def test_a_case_is_run_without_plots(case):
    done = subprocess.run([sys.executable, "-c", COMPUTE.format(case=case)], capture_output=True, text=True, check=True)
    assert not json.loads(done.stdout)
