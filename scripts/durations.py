"""Every reference answer with all its digits, as JSON: to compare the results before and after a change of the code.

python scripts/durations.py > before.json; …; python scripts/durations.py > after.json
python scripts/durations.py --compare before.json after.json
"""

import json
import math
import sys
import warnings
from pathlib import Path

import armdyn as ad
from armdyn.control.tracking.arrival import Arrival
from armdyn.paper import PAYLOADS
from armdyn.paper.continuous_pid import ContinuousLoop, simulate
from armdyn.paper.printed.loop import PAPER_RULE

warnings.simplefilter("ignore", ad.ArmdynWarning)
POSES = {
    "r": ([-math.pi / 2], [math.pi / 20]),
    "rr": ([-math.pi / 2, math.pi / 84], [math.pi / 20, -math.pi / 84]),
    "rrr": ([-math.pi / 2, math.pi / 84, -math.pi / 84], [math.pi / 20, -math.pi / 84, math.pi / 84]),
}
CASES = Path(__file__).parents[1] / "tests" / "cases"


def arm(name, mass):
    """One of the paper's arms."""
    return ad.Robot.from_spec(ad.ArmSpec.paper(name), ad.Payload(mass=mass))


def answers():
    """Names and numbers, one after the other."""
    for name, (start, goal) in POSES.items():
        for mass in PAYLOADS:
            robot = arm(name, mass)
            for kind, more in (("minimum time", {}), ("time-energy", {"effort_weight": 1.0, "effort_limit": 30.0})):
                problem = ad.MinimumTimeProblem(robot, q_start=start, q_goal=goal, **more)
                yield f"{name} {1000 * mass:g} g {kind}", ad.solve_minimum_time(problem).duration
            run = simulate(ContinuousLoop(robot, goal), start, Arrival(PAPER_RULE))
            yield f"{name} {1000 * mass:g} g PID, arrival", run.arrival_time
            yield f"{name} {1000 * mass:g} g PID, position at the end", float(run.trajectory.q[-1, 0])
    for path in sorted(CASES.glob("*/case.json")):
        case = json.loads(path.read_text())
        robot = ad.Robot.from_urdf(path.with_name("robot.urdf"))
        limits = {"effort_limit": (case["tau_lower"], case["tau_upper"]), "velocity_limit": math.inf}
        limits["position_limit"] = (-math.inf, math.inf)
        problem = ad.MinimumTimeProblem(robot, q_start=case["q0"], q_goal=case["qf"], **limits)
        yield case["name"], ad.solve_minimum_time(problem).duration


def compare(before, after):
    """Print relative differences of more than 1e-9."""
    worst = 0.0
    for name in before.keys() | after.keys():
        a, b = before.get(name), after.get(name)
        off = 0.0 if a == b else math.inf if a is None or b is None else abs(a / b - 1)
        worst = max(worst, off)
        if off > 1e-9:
            print(f"{name}: {a} -> {b} ({off:.1e})")
    print(f"{len(after)} answers, largest relative difference {worst:.1e}")


if __name__ == "__main__":
    if sys.argv[1:2] == ["--compare"]:
        compare(*(json.loads(Path(file).read_text()) for file in sys.argv[2:4]))
    else:
        print(json.dumps(dict(answers()), indent=1))
