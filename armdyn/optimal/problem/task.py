"""Task of a solve: problem, dynamics, scheme, options, policy."""

import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from typing import Any, Self, TypeVar

from armdyn.arguments import listener
from armdyn.codegen.deadline import NoTimeError, until
from armdyn.dynamics.symbolic import Dynamics
from armdyn.errors import ArmdynWarning, ProblemError
from armdyn.optimal.problem.options import MinimumTimeOptions, Scheme, SolverSettings
from armdyn.optimal.problem.policy.policy import Policy, policy_for
from armdyn.optimal.problem.problem import MinimumTimeProblem
from armdyn.optimal.problem.status import Status, Stop
from armdyn.parallel import shared_pool
from armdyn.reprs import joints_of

Result = TypeVar("Result")


@dataclass(frozen=True, eq=False)
class Task:
    """A problem with all settings of its solve.

    Attributes:
        problem: the minimum-time problem.
        dynamics: dynamics of the problem's robot, with a symbolic last body.
        scheme: transcription scheme.
        options: options of the user.
        policy: choices by the class of the problem, and tuned numbers.
        intervals: intervals of the mesh on which the optima of coarse meshes are told apart.
        stop: stopping condition, polled every few iterations.
        progress: called with a line of text on the current step.
        lower_bound: returns the proven lower bound on the duration [s], perhaps after a wait; None: no bound is known.
        pool: function of a worker pool that `results` calls, see `shared_pool`; None: each series starts its own pool.
    """

    problem: MinimumTimeProblem
    dynamics: Dynamics
    scheme: Scheme
    options: MinimumTimeOptions
    policy: Policy
    intervals: int
    stop: Stop = field(default_factory=Stop)
    progress: Callable[[str], None] = lambda text: None
    lower_bound: Callable[[], float | None] = lambda: None
    pool: Callable[[Sequence[Callable[[Any], Any]]], Iterator[Any]] | None = None

    @classmethod
    def of(
        cls,
        problem: MinimumTimeProblem,
        options: MinimumTimeOptions | None = None,
        stop: Stop | None = None,
        progress: Callable[[str], None] | None = None,
        policy: Policy | None = None,
    ) -> Self:
        """Make a task from a problem and a user's options.

        Args:
            problem: the minimum-time problem.
            options: by default `MinimumTimeOptions()`.
            stop: stopping condition; by default none.
            progress: called with progress messages; by default they are ignored.
            policy: choices for this problem; None: by its class and the method that the options name.

        Raises:
            ProblemError: a guess in the options has a different number of joints, or the method cannot solve the
                problem.
        """
        options = options or MinimumTimeOptions()
        for k, guess in enumerate(options.guesses):
            if guess.q.shape[1] != problem.robot.nv:
                name, joints = problem.robot.name, problem.robot.nv
                raise ProblemError(f"options.guesses[{k}] moves {joints_of(guess.q.shape[1])}, {name} has {joints}")
        policy = policy or policy_for(problem, options.method)
        stop = Stop() if stop is None else stop  # a stop is false until it stops
        dynamics, mesh = Dynamics(problem.robot, free_last_body=True), policy.search.fine_mesh
        scheme = Scheme("linear" if policy.program.linear else "constant", options.compile)
        return cls(problem, dynamics, scheme, options, policy, mesh, stop, listener(progress))

    def for_problem(self, problem: MinimumTimeProblem) -> Self:
        """The task for another problem, with the same overrides of the policy."""
        own = self.of(problem, self.options, self.stop, self.progress, self.policy.for_problem(problem))
        return replace(own, lower_bound=self.lower_bound, pool=self.pool)

    def with_options(self, **changes: Any) -> Self:
        """The task with some options changed."""
        return replace(self, options=replace(self.options, **changes))

    @property
    def workers(self) -> int | None:
        """Processes of search and refinement; None: one per core."""
        return self.options.workers if self.policy.search.side_by_side else 1

    @contextmanager
    def pooled(self, threads: bool = False) -> Iterator[Self]:
        """The task with a worker pool for several series of jobs; compiled programs are built before the first.

        Args:
            threads: see `shared_pool`.
        """
        with shared_pool(self, self.options.workers if threads else self.workers, threads) as pool:
            yield replace(self, pool=pool)

    def results(self, jobs: Sequence[Callable[[Self], Result]]) -> Iterator[Result]:
        """Yield the results of jobs in their order, on the task's workers.

        Args:
            jobs: functions of the task, in its state when the first jobs came; pickled to processes, not to threads.
        """
        if self.pool is not None:
            yield from self.pool(jobs)
            return
        with self.pooled() as task:
            yield from task.results(jobs)

    def in_time(self, build: Callable[[Scheme], Result]) -> Result:
        """Build with the scheme before the deadline; without compilation if the time is too short.

        Args:
            build: function of a scheme, such as a call of `ipopt_for`.
        """
        stop = self.stop
        with until(stop.deadline, lambda: stop.interrupted):
            if not stop.out_of_time:
                try:
                    return build(self.scheme)
                except NoTimeError:
                    stop.out_of_time = True
            return build(replace(self.scheme, compile=False))

    def coarse(self) -> list[SolverSettings]:
        """Settings of IPOPT for the search, used by the guesses in turn."""
        numbers = self.policy.program
        most = numbers.guess_iterations
        return [self._settings(numbers.coarse_tolerance, barrier, most) for barrier in numbers.coarse_barriers]

    def fine(self) -> SolverSettings:
        """Settings for a guess that is a solution on another mesh, to stay near it."""
        numbers = self.policy.program
        return self._settings(numbers.coarse_tolerance / 10, numbers.fine_barrier, numbers.guess_iterations)

    def alone(self) -> SolverSettings:
        """Settings for a single guess without a search."""
        return SolverSettings(self.policy.program.coarse_tolerance / 1000)  # nothing follows that would sharpen it

    def _settings(self, tolerance: float, barrier: float, most: int | None) -> SolverSettings:
        return SolverSettings(tolerance, most or SolverSettings.max_iterations, barrier)

    def not_advised(self, status: Status) -> tuple[str, ...]:
        """Options that are not advised: raised already, or without effect, as a time limit that was not reached.

        Args:
            status: of the task's solution.
        """
        unreached = () if status is Status.TIME_LIMIT else ("time_limit",)
        return tuple(dict.fromkeys((*self._raised, *unreached, *self._without_effect)))

    def warn_of_options(self, calm: float | None = None) -> None:
        """Warn of options that are raised, and have no effect on the problem.

        Args:
            calm: time that the solution spends on calm joints [s], where it might be a curve's; None: before the solve.
        """
        useless = self._without_effect
        if calm is not None:
            on_mesh = not (calm or self.policy.strategy.curves_alone or "calm" in useless)
            useless = {"calm": "the answer is a motion of a mesh, as fast as can be"} if on_mesh else {}
        for name, why in useless.items():
            if name in self._raised:
                warnings.warn(f"`{name}` has no effect here: {why}", ArmdynWarning, stacklevel=3)

    @property
    def _raised(self) -> tuple[str, ...]:
        """Options above their defaults."""
        policy, options, usual = self.policy, self.options, MinimumTimeOptions()
        own = policy.curves if policy.strategy.curves_alone else policy.search
        raised = {
            "search": options.search == "thorough",
            "starts": (options.starts or 0) > own.starts,
            "max_intervals": options.max_intervals > usual.max_intervals,
            "calm": options.calm > usual.calm,
            "bound_programs": options.bound_programs is not None,
        }
        return tuple(name for name, chosen in raised.items() if chosen)

    @property
    def _without_effect(self) -> dict[str, str]:
        """Options without effect on the problem, and why."""
        problem, methods = self.problem, self.policy.strategy.methods
        useless = {"bound_programs": "it is of cycles"}
        if methods == ("profiles",):
            return useless | dict.fromkeys(
                ("search", "starts", "max_intervals", "calm"), "joints have one profile each"
            )
        if "curves" not in methods:
            return useless | {"calm": "motions of a mesh are as fast as can be"}
        if problem.pays_effort or problem.has_regions:
            useless["calm"] = "no time is spent on calm joints with a weight on effort, or through regions"
        if self.policy.strategy.curves_alone:
            useless["max_intervals"] = "motions are curves, which have no mesh"
            if problem.has_clearance or problem.has_regions or (len(problem.poses) > 2 and problem.jerk_limit is None):
                useless |= dict.fromkeys(("search", "starts"), "paths are planned, and are the guesses")
        return useless
