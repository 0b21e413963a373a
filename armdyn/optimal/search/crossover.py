"""Crossover and mutation of optima into further guesses: good optima lie near each other.

Optima that random poses reach once in hundreds of guesses are reached by one crossover of the best optima in ten. A
child has a small bend added to all joints, a detour of one joint, or the motions of some joints from another optimum.
(Leary, Global optimization on funneling landscapes, 2000; of trajectories Vasile, Minisci and Locatelli, 2011.)
"""

from collections.abc import Sequence

import numpy as np

from armdyn.optimal.problem.problem import MinimumTimeProblem
from armdyn.optimal.program.guesses import Guesses
from armdyn.optimal.search.distinct import distinct
from armdyn.optimal.search.multistart import SearchSettings, in_bunches
from armdyn.optimal.search.starts import SAMPLES
from armdyn.optimal.solve.attempt import Attempt
from armdyn.optimal.solve.condensed import guess_jobs
from armdyn.optimal.task.policy.search import SearchPolicy
from armdyn.optimal.task.task import Task


def crossover_guesses(
    task: Task, attempts: Sequence[Attempt], count: int, search_settings: SearchSettings, first: int = 0
) -> list[Attempt]:
    """Attempts from children of the best optima, round by round, from the best so far.

    The same attempts and seed give the same result on any number of cores.

    Args:
        task: the problem and its settings.
        attempts: attempts of the search so far.
        count: number of children.
        search_settings: meshes and solver settings, used in turn.
        first: index of the first child, which varies the random numbers.
    """
    numbers, same, children = task.policy.search, task.policy.same, list[Attempt]()
    while len(children) < count and not task.stop:
        best = distinct([*attempts, *children], same.coarse, same.apart)[: numbers.parents]
        if not best:
            break
        parents = Guesses.sampled([attempt.trajectory for attempt in best], SAMPLES)
        about = best[0].trajectory.duration
        task.progress(f"search: child {len(children)} of {count} of the best optima, about {about:.4f} s")

        several = range(first + len(children), first + min(count, len(children) + numbers.round))
        seeded = [(np.random.default_rng([task.options.seed, k]), k) for k in several]
        guesses = Guesses.joined([crossover(task.problem, parents, random, k, numbers) for random, k in seeded])
        children += in_bunches(guess_jobs(task, guesses, [search_settings.of(k) for k in several]), task)
    return children


def crossover(
    problem: MinimumTimeProblem,
    parents: Guesses,
    random: np.random.Generator,
    number: int,
    policy: SearchPolicy,
) -> Guesses:
    """A child of one of some motions, most often of one of the first, slowed down a little.

    Args:
        problem: problem with the position limits that the child keeps.
        parents: motions, best first.
        random: random generator.
        number: index of the child: the kinds of change are used in turn.
        policy: sizes of the changes.
    """
    many = len(parents.t)
    chosen, other = random.exponential(policy.favoured, 2).astype(int) % many
    duration = parents.durations[chosen]
    q, v, tau = (part[chosen].copy() for part in (parents.q, parents.v, parents.tau))
    bend = np.zeros(q.shape[1])
    if number % 3 == 0:
        way = np.abs(np.asarray(problem.q_goal) - np.asarray(problem.q_start))
        bend = policy.bend * random.normal(size=bend.size) * np.maximum(way, policy.bow)
    elif number % 3 == 1 and many > 1 and bend.size > 1:
        mate = other if other != chosen else (chosen + 1) % many
        taken = random.permutation(bend.size) < random.integers(1, bend.size)
        q[:, taken], tau[:, taken] = parents.q[mate][:, taken], parents.tau[mate][:, taken]
        v[:, taken] = parents.v[mate][:, taken] * parents.durations[mate] / duration
    else:
        bend[random.integers(bend.size)] = policy.led * random.uniform(-1, 1)
    s = np.linspace(0, 1, len(q))
    bow = 4 * s * (1 - s)
    q += (bow**3)[:, None] * bend
    v += (12 * bow**2 * (1 - 2 * s))[:, None] * bend / duration
    q[1:-1] = np.clip(q[1:-1], problem.limits.position_lower, problem.limits.position_upper)
    return Guesses(s[None] * (policy.slack * duration), q[None], v[None] / policy.slack, tau[None])
