"""Lines of the six examples: published and computed times, and the result in words."""

from collections.abc import Iterable, Iterator

from armdyn.paper.outcomes.outcome import Outcome
from armdyn.paper.printed.published import printed_time
from armdyn.paper.tables.rows import setup

HEADER = ("#", "arm", "problem", "paper", "ours", "result")
_PROBLEMS = {"minimum_time": "minimum time", "time_energy": "time–energy", "pid": "PID"}


def example_lines(outcomes: Iterable[Outcome]) -> Iterator[tuple[str, ...]]:
    """A line of `HEADER` for each example as the paper describes it, in the paper's order."""
    for outcome in sorted(outcomes, key=lambda o: (o.case.example, o.case.kind)):
        case = outcome.case
        if case.reading != "tip" or setup(case):
            continue
        paper = printed_time(case.example, case.payload)
        yield (
            str(case.example),
            case.arm.upper(),
            _PROBLEMS[case.kind],
            "-" if paper is None else f"{paper.value:.3f} s",
            "-" if outcome.time is None else f"{outcome.time:.4f} s",
            _result(outcome),
        )


def _result(outcome: Outcome) -> str:
    facts = outcome.facts
    if outcome.case.kind == "pid":
        return f"{outcome.status.replace('_', ' ')}, max Re λ = {facts['max_real_eigenvalue']:+.3f} 1/s"
    if not outcome.success:
        return outcome.message
    missed = f"replay ends {facts['goal_error']:.0e} rad from the goal"
    landed = "locally optimal (Pontryagin)" if facts["certified"] else missed
    indirect = facts.get("indirect_time_s")
    if not isinstance(indirect, float) or outcome.time is None:
        return landed
    apart = abs(indirect - outcome.time)
    return f"{landed}; indirect method {f'differs by {apart:.0e} s' if apart > 1e-12 else 'agrees to rounding'}"
