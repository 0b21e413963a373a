"""Time armdyn against a plain CasADi script, rockit's and Drake's DirectCollocation, in one run.

With --loops its closed loop is timed against MuJoCo and Drake's Simulator, ten seconds of three joints at 1 kHz.
Times are wall times of a solve, the median of --repeats runs after one that is dropped (unless that one alone
takes more than 10 s); "ratio" is to armdyn's one solve. Building functions is not in them, but in its own column [s].
Every answer has its torques replayed through pin.aba: "replay" is the largest position error at the goal [rad].
"excess" is the worst of its limits between samples, relative to the limit: where one of the two is large, t_f is no
motion's.
"""

import argparse
import importlib.util
import json
import os
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from peers.protocol import CASES, INTERVALS, problem

import armdyn as ad
from armdyn.optimal.verify.within_limits import limit_violation

PEERS = Path(__file__).resolve().parent / "peers"
ROWS = (
    ("armdyn, search + certificate", "own.py", "full", "armdyn"),
    (f"armdyn, one solve, N = {INTERVALS}", "own.py", "mesh", "armdyn"),
    ("armdyn, one curve", "own.py", "curve", "armdyn"),
    ("CasADi Opti + IPOPT, MX", "plain_casadi.py", "MX", "casadi"),
    ("CasADi Opti + IPOPT, SX", "plain_casadi.py", "SX", "casadi"),
    ("rockit + IPOPT", "rockit_collocation.py", "IPOPT", "rockit"),
    ("Drake + SNOPT", "drake_collocation.py", "SNOPT", "pydrake"),
    ("Drake + IPOPT", "drake_collocation.py", "IPOPT", "pydrake"),
)
SHOWN = {"duration": "9.5f", "time": "9.3f", "ratio": "7.1f", "building": "9.2f", "replay": "8.1e", "excess": "8.1e"}


def measure(case: str, row: tuple[str, str, str, str], repeats: int, timeout: float, folder: Path) -> dict:
    """One peer on one case, in a process of its own that is ended after `timeout` seconds."""
    name, script, method, package = row
    blank = {"case": case, "method": name} | dict.fromkeys(SHOWN)
    if importlib.util.find_spec(package) is None:
        return blank | {"status": f"{package} is not installed"}
    out = folder / "answer.npz"
    command = [sys.executable, str(PEERS / script), "--case", case, "--method", method, "--repeats", str(repeats)]
    try:
        run = subprocess.run([*command, "--out", str(out)], capture_output=True, text=True, timeout=timeout)  # noqa: S603
    except subprocess.TimeoutExpired:
        return blank | {"status": f"no answer in {timeout:g} s"}
    if run.returncode:
        return blank | {"status": f"failed: {(run.stderr.strip().splitlines() or ['?'])[-1][:80]}"}
    output = json.loads(run.stdout.strip().splitlines()[-1])
    found, request = ad.Trajectory.load(out), problem(case)
    end = ad.replay_torques(request.robot, found)
    landed = float(np.max(np.abs(end.q[-1] - request.q_goal))) if end.t[-1] == found.t[-1] else float("inf")
    numbers = {"duration": found.duration, "time": statistics.median(output["times"])}
    return blank | output | numbers | {"replay": landed, "excess": limit_violation(request.limits, found)}


def measure_loops(repeats: int, timeout: float) -> None:
    """Print the median time of ten seconds of a closed loop, its ratio to armdyn's, and where it ends [rad]."""
    ends, base = None, None
    print("loop, 10 s at 1 kHz    time [s]   ratio  apart [rad]")
    for peer, package in (("armdyn", "armdyn"), ("mujoco", "mujoco"), ("drake", "pydrake")):
        if importlib.util.find_spec(package) is None:
            print(f"{peer:20} {package} is not installed")
            continue
        command = [sys.executable, str(PEERS / "loops.py"), "--peer", peer, "--repeats", str(repeats)]
        run = subprocess.run(command, capture_output=True, text=True, timeout=timeout, check=True)  # noqa: S603
        output = json.loads(run.stdout.strip().splitlines()[-1])
        median = statistics.median(output["times"])
        base, ends = base or median, output["end"] if ends is None else ends
        apart = np.abs(np.subtract(output["end"], ends)).max()
        print(f"{peer:20} {median:10.4f} {median / base:7.1f}  {apart:10.1e}", flush=True)
    arm = ad.Robot.from_spec(ad.ArmSpec.paper("rrr"), ad.Payload(mass=0.1006))
    ramp, options = ad.ramp(arm, [-1.0, 0.3, -0.2], [0.3, -0.2, 0.1], 0.6), ad.MonteCarloOptions(duration=10.0)
    for word, friction in (("without friction", 0.0), ("with friction", 0.06)):
        begun = time.perf_counter()
        found = ad.monte_carlo(arm, ramp, plants=ad.Plants(coulomb=(0, friction), seed=1), options=options)
        seconds, cores = time.perf_counter() - begun, os.cpu_count()
        print(f"armdyn, 1,000 arms of 10 s, Lqr, {word}: {seconds:.1f} s on {cores} cores, {found.success()}")


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--only", choices=CASES, nargs="+", default=["r", "rr", "rrr", "panda"])
    parser.add_argument("--repeats", type=int, default=3)
    parser.add_argument("--timeout", type=float, default=180.0, help="of a peer, all repeats and building together [s]")
    parser.add_argument("--json", action="store_true", help="one JSON object per row")
    parser.add_argument("--loops", action="store_true", help="closed loops instead: armdyn, MuJoCo, Drake")
    args = parser.parse_args()
    if args.loops:
        measure_loops(args.repeats, args.timeout)
        return
    if not args.json:
        print(f"{'case':6} {'method':30}   t_f [s]  time [s]   ratio  building   replay   excess  status")
    for case in args.only:
        with tempfile.TemporaryDirectory() as folder:
            rows = [measure(case, row, args.repeats, args.timeout, Path(folder)) for row in ROWS]
        for row in rows:
            row["ratio"] = row["time"] / rows[1]["time"] if row["time"] and rows[1]["time"] else None
            cells = " ".join("-".rjust(int(f[0])) if row[k] is None else format(row[k], f) for k, f in SHOWN.items())
            print(json.dumps(row) if args.json else f"{case:6} {row['method']:30} {cells}  {row['status']}", flush=True)


if __name__ == "__main__":
    main()
