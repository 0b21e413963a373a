"""Every tuned number is read from the policy of the task: unread numbers, or those read off their class, fail."""

import ast
import dataclasses
import sys
import warnings
from dataclasses import fields, is_dataclass, replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

import armdyn as ad
from armdyn.models.scene.reaching import frame_placement
from armdyn.optimal import resolver as live
from armdyn.optimal.bound.chain import chain_bound
from armdyn.optimal.bound.lattice import Effort
from armdyn.optimal.bound.lower_bound import lower_bound
from armdyn.optimal.constraints.regions import FrameRegion
from armdyn.optimal.constraints.registry import TightenedConstraints
from armdyn.optimal.curves.curves import _guesses, curves
from armdyn.optimal.curves.goals import screened
from armdyn.optimal.mesh.search import in_batches, search
from armdyn.optimal.mesh.starts import spline, via_guesses
from armdyn.optimal.minimum_time import solve_task
from armdyn.optimal.problem.policy.policy import Policy
from armdyn.optimal.problem.status import Stop
from armdyn.optimal.problem.task import Task
from armdyn.studies.tasks import minimum_time
from armdyn.studies.tasks.task import motion_bytes
from problems import POSES, cart, gantry_problem, paper_arm, paper_problem, random_problem

SOURCES = Path(ad.__file__).parent
READ = set()
"""Names of numbers, `group.field`, that were read from an instance since the set was cleared."""

COPIES = {dataclasses.__file__, "<string>"}
"""Files of the code that copies, compares and hashes dataclasses: no readers."""


def noting(name, group):
    """The group, as one that notes which of its fields are read."""
    own = {field.name for field in fields(group)}

    class Noting(type(group)):
        def __getattribute__(self, field):
            if field in own and sys._getframe(1).f_code.co_filename not in COPIES:
                READ.add(f"{name}.{field}")
            return super().__getattribute__(field)

    return Noting(**{field: getattr(group, field) for field in own})


class Noted(Policy):
    """A policy whose groups note which of their fields are read; those for other problems do so, too."""

    @classmethod
    def of(cls, problem):
        policy = super().of(problem)
        groups = {field.name: getattr(policy, field.name) for field in fields(policy)}
        return replace(policy, **{name: noting(name, group) for name, group in groups.items() if is_dataclass(group)})


def noted(problem, changes=(), **options):
    """A task with such a policy, perhaps changed."""
    task, policy = Task.of(problem, ad.MinimumTimeOptions(workers=1, **options)), Noted.of(problem)
    for group, numbers in changes:
        policy = policy.changed(group, **numbers)
    return replace(task, policy=policy).for_problem(problem)


def by_curves(task):
    """The task with curves as its only method, as where no other finds a motion."""
    return replace(task, policy=task.policy.by("curves"))


def between(arm, robot=None, **more):
    """The paper's motion of an arm, perhaps of another robot."""
    start, goal = POSES[arm]
    return ad.MinimumTimeProblem(robot or paper_arm(arm), q_start=start, q_goal=goal, **more)


def posed(arm, **more):
    """The paper's start, and a place for the tip, which two links reach in two ways and three in many."""
    return ad.MinimumTimeProblem(
        paper_arm(arm), q_start=POSES[arm][0], goal_pose=ad.GoalPose("tip", [0.35, 0, 0.1]), **more
    )


BALL = ad.Sphere((0.3, 0.0, -0.1), 0.05)

MESH = ("strategy", {"methods": ("mesh",), "bounded": False})

SOLVES = {
    "switching times": lambda: noted(between("r")),
    "the mesh's own motion": lambda: noted(between("r"), (("polish", {"rounds": 0}),)),
    "a thorough search": lambda: noted(between("r"), search="thorough"),
    "time and energy": lambda: noted(between("r", effort_weight=1.0), starts=2),
    "a via region": lambda: noted(
        between("rr", via=[ad.GoalPose("tip", (0.3, 0, -0.1), tolerance=[0.02] * 3 + [0] * 3)])
    ),
    "velocity limits on a rail": lambda: noted(
        ad.MinimumTimeProblem(cart(), q_start=[0.0], q_goal=[1.0], velocity_limit=0.5)
    ),
    "two joints, one of which is idle": lambda: noted(gantry_problem(), starts=2),
    "a velocity limit that slowing down mends": lambda: noted(
        between("rr", velocity_limit=8.0),
        [
            MESH,
            ("motion_mesh", {"rounds": 0}),
        ],
        starts=1,
        max_intervals=40,
    ),
    "meshes that do not converge, and one that is divided": lambda: noted(
        between("rr", velocity_limit=20.0),
        [MESH, ("motion_mesh", {"iterations": 1, "rounds": 2})],
        starts=1,
    ),
    "in flight": lambda: noted(between("r", velocity_limit=3.0, v_start=[3.0], acceleration_limit=100.0), starts=1),
    "profiles": lambda: noted(between("rr", velocity_limit=3.0, acceleration_limit=20.0, jerk_limit=500.0)),
    "three joints": lambda: noted(random_problem(2), starts=3),
    "a contact": lambda: noted(random_problem(5), starts=3),
    "changes of optima": lambda: noted(paper_problem("rrr", 0.1505), starts=16),
    "a search that is done again": lambda: noted(
        between("rr"), [("search", {"too_coarse": 0.5, "too_coarse_confirmed": 0.5})], starts=2
    ),
    "a ball in the way, with steps that are not taken at once": lambda: noted(
        between("rr", obstacles=[ad.Sphere((0.3, 0, -0.1), 0.04)]), [("sequential", {"eager": 0})], starts=1
    ),
    "a pose": lambda: noted(
        ad.MinimumTimeProblem(
            paper_arm("rr"), q_start=POSES["rr"][0], goal_pose=ad.GoalPose("tip", [0.35, 0, 0.3], free=("z",))
        ),
        starts=1,
    ),
}
"""Tasks of a fraction of a second to two seconds."""


def guesses_round_a_ball():
    problem = between("rr", obstacles=[BALL])
    via_guesses(problem, 0, 2, policy=Noted.of(problem).search)


def constraints_that_are_tightened():
    """Each stricter, and at more points, than a straight and hasty motion satisfies."""
    strip = ad.FrameRegion(ad.GoalPose("tip", (0.24, 0, 0), ("z",), (0.24, 0, 0, 0, 0, 0)))
    problem = between("rr", obstacles=[BALL], acceleration_limit=1.0, path_constraints=[strip])
    constraints = TightenedConstraints.of(noted(problem))
    constraints.rows(problem)
    hasty = spline(problem, [], 0.1)
    for _ in range(5):
        constraints = constraints.tightened(problem, constraints.check(problem, hasty, np.empty(0)))


def bounds_of_a_pose():
    problem = posed("rr", velocity_limit=10.0)
    for policy in (Noted.of(problem), Noted.of(problem).changed("bound", few=1)):
        lower_bound(problem, policy=policy.bound)


def bound_of_a_line():
    """Up along a straight line and down along another one, and through blends instead of them."""
    robot, q = ad.Robot.from_library("ur5"), np.array([-0.67, -1.44, 2.03, -0.58, 0.9, 0.0])
    goal, most = q + np.array([0.7, 0, 0, 0, 0.7, 0]), (3.5e-4, 3.5e-4, 0.0, 5e-3, 5e-3, 5e-3)
    here, there = (frame_placement(robot, robot.tip, one).homogeneous for one in (q, goal))
    above, beyond = (one - 0.025 * np.outer(one[:, 2], [0, 0, 0, 1]) for one in (here, there))
    lines = [
        FrameRegion(ad.GoalPose(robot.tip, at, free=("z",), tolerance=most), leg=leg)
        for leg, at in ((0, here), (2, there))
    ]
    passed = [ad.GoalPose(robot.tip, at, tolerance=most) for at in (above, beyond)]
    problem = ad.MinimumTimeProblem(robot, q_start=q, q_goal=goal, via=passed, path_constraints=lines)
    wide = [replace(one, tolerance=(0.01,) * 6) for one in passed]
    for one in (problem, ad.MinimumTimeProblem(robot, q_start=q, q_goal=goal, via=wide)):
        chain_bound([one], [q, goal], 0.4, Effort(600), Noted.of(one).bound)


def goals_as_coarse_curves():
    screened(noted(posed("rr", relative_effort_weight=0.5)))


def a_guess_with_ramps():
    guesses = _guesses(noted(between("rr", velocity_limit=5.0, jerk_limit=500.0, via=[[-0.5, 0.3]])), 3)
    assert [guess.duration / guesses[0].duration for guess in guesses] == pytest.approx([1, 1.5, 1 / 1.5])


def a_curve_after_an_interrupt():
    task = by_curves(replace(noted(between("rr", velocity_limit=5.0)), stop=Stop()))
    curves(replace(task, progress=lambda text: task.stop.interrupt()))


def a_price_that_is_too_low():
    """No step is better, as torques beyond their limits cost nearly nothing."""
    cheap = by_curves(noted(between("rr", velocity_limit=5.0), [("sequential", {"price": 1e-9})]))
    curves(cheap)


def curves_that_do_not_converge():
    few = by_curves(noted(between("rr", velocity_limit=5.0)))
    curves(replace(few, policy=few.policy.changed("sequential", steps=1).changed("curves", patience=1)))


def guesses_for_two_workers():
    list(in_batches([], noted(between("rrr")).with_options(workers=2)))


def many_guesses():
    task = noted(between("rrr"))
    search(task, task.policy.search.tested, [(15, next(iter(task.coarse())))])


class Neighbours:
    """The problems of a study whose cases are all the same."""

    def problem(self, settings):
        return between("r")


def a_neighbour_of_a_study():
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(minimum_time, "Policy", Noted)
        task = minimum_time.MinimumTimeTask(problems=Neighbours(), neighbours="lead")
        task.work({}, motion_bytes(spline(between("r"), [])))


def motions_from_moving_states():
    """The second is to go on along the first, the third to brake; a ball makes distances be computed."""
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(live, "Policy", Noted)
        arm = ad.Robot.from_library("panda")
        ready, there = np.array([0, -0.785, 0, -2.356, 0, 1.571, 0.785]), np.array([1, 0.2, 0.5, -1.5, 0.3, 2, -0.5])
        resolver = ad.Resolver(arm, obstacles=[ad.Sphere((2.0, 0, 0), 0.1)])
        first = resolver.solve(ready, np.zeros(7), there)
        at = first.trajectory(0.3)
        resolver.solve(at.q, at.v, ready, deadline=1e-9)
        ad.Resolver(arm, acceleration_limit=100.0).solve(at.q, at.v, ready, deadline=1e-9)


CALLS = (
    motions_from_moving_states,
    guesses_round_a_ball,
    constraints_that_are_tightened,
    bounds_of_a_pose,
    bound_of_a_line,
    goals_as_coarse_curves,
    a_guess_with_ramps,
    a_curve_after_an_interrupt,
    a_price_that_is_too_low,
    curves_that_do_not_converge,
    guesses_for_two_workers,
    many_guesses,
    a_neighbour_of_a_study,
)


def facts(solution):
    """All that may tell two solves apart, as text."""
    return repr([
        solution.duration, solution.status, solution.certificate, solution.iterations, solution.lower_bound,
        solution.local_optima, solution.arcs, solution.trajectory.t.size,
    ])  # fmt: skip


@cache
def solved_once(name):
    """A task of `SOLVES`, the facts of its solution, and the names of the numbers that were read."""
    READ.clear()
    task = SOLVES[name]()
    solution, read = solve_task(task), frozenset(READ)
    return task, facts(solution), read


@pytest.fixture(scope="module")
def read():
    """Names of all numbers that are read in the solves and calls above."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ad.ArmdynWarning)  # goals that an arm cannot hold
        solves = [solved_once(name)[2] for name in SOLVES]
        READ.clear()
        for call in CALLS:
            call()
    return READ.union(*solves)


@pytest.mark.slow
def test_every_number_is_read_from_the_task_s_policy(read):
    every = {name for name, *_ in Policy.of(between("rr")).rows()}
    assert sorted(every ^ read) == []


CHANGED = {
    "switching times": {
        "polish": {"segments": 8, "steps": 4},
        "program": {
            "coarse_barriers": (2e-3, 2e-2),
            "coarse_tolerance": 1e-6,
            "condensed": False,
            "fine_barrier": 1e-5,
        },
        "search": {"guess_duration": 0.5, "starts": 3, "meshes": (30, 50)},
    },
    "velocity limits on a rail": {
        "curves": {"intervals": 40, "shortest": 1e-3},
        "bound": {"growth": 2.0, "passes": 1, "shortest": 1e-3},
    },
    "three joints": {
        "same": {"distance": 3.0, "coarse": 0.02},
        "search": {
            "least_spread": 0.2,
            "midpoint_spread": 0.03,
            "mutation_duration": 0.12,
            "uniform_spread": 0.8,
            "only_listed": 0.12,
            "too_coarse": 0.1,
        },
    },
    "a contact": {
        "arcs": {"in_contact": 0.05},
    },
}
"""Numbers by their groups that change the result of a solve of `SOLVES`, or its way."""


@pytest.mark.slow
@pytest.mark.parametrize("name", CHANGED)
def test_another_number_gives_another_answer(name):
    task, before, _ = solved_once(name)
    assert facts(solve_task(task)) == before
    changes = [(group, {field: value}) for group, numbers in CHANGED[name].items() for field, value in numbers.items()]
    others = [replace(task, policy=task.policy.changed(group, **number)) for group, number in changes]
    assert [change for change, other in zip(changes, others, strict=True) if facts(solve_task(other)) == before] == []


def test_a_copy_is_no_reader():
    problem = between("rr")
    policy = Noted.of(problem)
    READ.clear()
    other = policy.changed("search", starts=3)
    assert other == replace(other) and not replace(other.strategy).curves_alone
    assert sorted(READ) == ["strategy.methods"]  # by the policy's own rule
    assert other.for_problem(between("r")).search.starts == 3
    assert sorted(READ) == ["search.starts", "strategy.methods"]


def test_no_module_reads_a_number_off_a_class():
    off = []
    for path in sorted(SOURCES.rglob("*.py")):
        text = path.read_text()
        if "Policy" not in text:
            continue
        tree = ast.parse(text)
        imported = (node for node in ast.walk(tree) if isinstance(node, ast.ImportFrom))
        names = {each.asname or each.name for node in imported if "policy" in str(node.module) for each in node.names}
        names = {name for name in names if name.endswith("Policy")}
        off += [
            f"{path.relative_to(SOURCES)}:{node.lineno}: {node.value.id}.{node.attr}"
            for node in ast.walk(tree)
            if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name)
            if node.value.id in names and node.attr != "of"
        ]
    assert off == []
