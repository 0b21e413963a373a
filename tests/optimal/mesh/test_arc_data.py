"""Structures as bounds of a program: where limits of position hold."""

from dataclasses import replace

import numpy as np
import pytest

from armdyn.optimal.mesh.arc_data import assemble_arcs
from armdyn.optimal.mesh.layout import Layout
from armdyn.optimal.problem.task import Task
from armdyn.optimal.verify.arc import Mode
from problems import solved


@pytest.mark.parametrize("near", [False, True])
def test_near_a_solution_a_touched_limit_holds_only_where_it_is_touched(near):
    solution = solved("rr")
    task, phases = Task.of(solution.problem), solution.phases
    touching = replace(phases.arcs[0], touches=((0, Mode.POSITION_UPPER),))
    layout = Layout(2, replace(task.scheme, control="stage"))
    nlp_data = assemble_arcs(task, (touching, *phases.arcs[1:]), phases.torques, layout, 24, near)
    knots, inner = layout.states(24), layout.inner_states(24)
    upper, lower = nlp_data.x_bounds[1], nlp_data.x_bounds[0]
    touched = int(np.flatnonzero(np.diff(nlp_data.arc_of))[0]) + 1
    others = [k for k in range(1, 24) if k != touched]
    limit = solution.problem.limits.position_upper[0] / nlp_data.scales.length
    assert upper[knots[touched, 0]] == lower[knots[touched, 0]] == pytest.approx(limit)
    assert np.all(np.isinf(upper[knots[others][:, 0]]) == near)
    assert np.all(np.isinf(upper[inner[..., 0]]) == near)
    # The lower limit and the other joint's stay.
    assert np.all(np.isfinite(lower[knots[others]][:, :2]))
    assert np.all(np.isfinite(upper[knots[others][:, 1]]))
