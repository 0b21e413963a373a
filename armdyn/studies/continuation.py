"""Similar problems in a row: each optimum is where the search for its neighbour's begins, there and back."""

from collections.abc import Callable, Sequence
from dataclasses import replace

from armdyn.arguments import expect
from armdyn.errors import ProblemError
from armdyn.optimal import MinimumTimeOptions, MinimumTimeProblem, Solution, Status, solve_minimum_time
from armdyn.optimal.proof.certificate import GAP_TOLERANCE
from armdyn.optimal.refine.smooth import trajectory_cost
from armdyn.optimal.task.policy import Policy
from armdyn.optimal.task.policy.search import SamePolicy


def continuation(
    problems: Sequence[MinimumTimeProblem],
    options: MinimumTimeOptions | None = None,
    progress: Callable[[str], None] | None = None,
    done: Callable[[int, Solution], None] | None = None,
) -> tuple[Solution, ...]:
    """Optima of similar problems, as the minimum times of one motion with more and more payload.

    The first is searched as `solve_minimum_time` does. Each of the others begins with its neighbour's optimum
    beside fewer guesses of its own; then, backwards, an optimum that a later problem has found is tried on the
    one before, unless that is proven to be about as fast as can be. The same model with other payloads, limits or
    poses is built and compiled once.

    Args:
        problems: in an order in which neighbours resemble each other.
        options: of every solve; `starts` is that of all, if it is given. A time limit is each solve's own.
        progress: called with a line of text on what is being tried.
        done: told the number and the solution of a problem, again where the way back finds a faster one.

    Returns:
        A solution for each problem, in their order; after Ctrl-C those that there were.

    Raises:
        ProblemError: the problems' robots differ in their joints.
    """
    options = MinimumTimeOptions() if options is None else expect(options, MinimumTimeOptions, "options")
    names = [problem.robot.joint_names for problem in problems]
    for k, own in enumerate(names):
        if own != names[0]:
            raise ProblemError(f"problems[{k}] moves {', '.join(own)}; the first moves {', '.join(names[0])}")
    found: list[Solution] = []
    search = Policy.of(problems[0]).search if problems else None
    few = search.guesses(options, search.neighbour_starts) if search else None

    def solve(k: int, neighbour: Solution | None, starts: int | None) -> Solution:
        given = options
        if neighbour is not None:
            given = replace(options, starts=starts, guesses=(*options.guesses, neighbour.trajectory))
        return solve_minimum_time(
            problems[k], given, progress and (lambda text: progress(f"{k + 1} of {len(problems)}: {text}"))
        )

    for k in range(len(problems)):
        found.append(solve(k, next((s for s in reversed(found) if s.success), None), few))
        if done:
            done(k, found[k])
        if found[k].status is Status.INTERRUPTED:
            return tuple(found)
    for k in range(len(problems) - 2, -1, -1):
        if not found[k + 1].success or _is_proven(found[k]) or _is_neighbours(found[k], found[k + 1]):
            continue
        other = solve(k, found[k + 1], 1)
        if _better(other, found[k]):
            found[k] = other
            if done:
                done(k, other)
        if other.status is Status.INTERRUPTED:
            break
    return tuple(found)


def _is_proven(solution: Solution) -> bool:
    """A proven lower bound is so near that no other motion is worth a search."""
    return solution.gap is not None and solution.gap_proven and solution.gap <= GAP_TOLERANCE


def _is_neighbours(solution: Solution, later: Solution) -> bool:
    """Both optima have the same arcs: they are one branch's, and there is nothing to try.

    Where effort is paid for torques are on no limit, and their arcs say nothing.
    """
    own, other = ([arc.modes for arc in s.arcs] for s in (solution, later))
    return bool(own) and own == other and not solution.problem.pays_effort


def _better(solution: Solution, other: Solution) -> bool:
    if solution.success != other.success:
        return solution.success
    return _cost(solution) < _cost(other) * (1 - SamePolicy.resolved)


def _cost(solution: Solution) -> float:
    """What is least [s]: the duration, and the effort that is paid for."""
    effort = trajectory_cost(solution.trajectory, solution.problem.effort_weight) - solution.trajectory.duration
    return solution.duration + effort
