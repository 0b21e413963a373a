"""Loads mutated URDFs by the thousand: each must give a robot or an ArmdynError, in bounded time and memory.

A mutation is its number: the same number, the same file. Each slice runs in a process of its own, so that a
crash is seen, named by its number, and passed over.

    scripts/fuzz_urdf.py --count 10000
    scripts/fuzz_urdf.py --first 10000 --count 10000        # others
    scripts/fuzz_urdf.py --first 4711 --count 1 --keep x.urdf   # one of them, to look at
"""

import argparse
import json
import re
import resource
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

BASES = {"r": (), "rrr": (), "ur5": (), "panda": ("panda_finger_joint1",), "kinova": (), "z1": ("jointGripper",),
         "tiago_pro": ("gripper_left_finger_joint", "gripper_right_finger_joint")}  # fmt: skip
"""Mutated robots by name, and their locked joints."""

TIME, MEMORY = 20, 2**30  # [s] and [bytes] that a file may take


def kind_of(error: Exception) -> str:
    """An error's class and its words, without parts that differ from file to file."""
    words = re.sub(r"(link|joint) '.*?': ", "", str(error).split(": ", 1)[-1])
    words = re.sub(r"'.*?'|[(\[].*|[-+]?[0-9.]+(e[-+]?[0-9]+)?|(?<=through ).*|(?<=roots, ).*", "…", words)
    words = re.sub(r"(<\w+[> ])\w+=|lacks \w+$", r"\1…=", words)
    return f"{type(error).__name__}: {words[:60]}"


def work(numbers: range, keep: str | None) -> None:
    """Load these mutations, one line of JSON each."""
    import numpy as np
    import pinocchio as pin

    from armdyn.errors import ArmdynError
    from armdyn.models import PLANAR_ARMS, ArmSpec, Robot, urdf_from_spec
    from armdyn.models.robots.library import library_urdf
    from mutations import mutated

    bases = [
        (urdf_from_spec(ArmSpec.paper(name)) if name in PLANAR_ARMS else library_urdf(name)[0].read_text(), joints)
        for name, joints in BASES.items()
    ]
    now = int(re.search(r"VmSize:\s+(\d+)", Path("/proc/self/status").read_text())[1]) * 1024
    resource.setrlimit(resource.RLIMIT_AS, (now + MEMORY, now + MEMORY))
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    with tempfile.TemporaryDirectory() as folder:
        path = Path(keep or f"{folder}/mutated.urdf")
        for number in numbers:
            text, joints = bases[number % len(bases)]
            path.write_bytes(mutated(text, number))
            signal.alarm(TIME)
            started = time.perf_counter()
            try:
                robot = Robot.from_urdf(path, lock=dict.fromkeys(joints, 0.0))
                tau = pin.rnea(robot.model, robot.model.createData(), pin.neutral(robot.model), *np.ones((2, robot.nv)))
                kind = "loaded" if np.all(np.isfinite(tau)) else "BAD: loaded, torques not finite"
            except ArmdynError as error:
                kind = kind_of(error)
            except BaseException as error:
                kind = f"BAD: {type(error).__name__}: {str(error)[:80]}"
            taken = time.perf_counter() - started
            signal.alarm(0)
            peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before
            sys.stdout.write(json.dumps([number, kind, taken, peak]) + "\n")
            sys.stdout.flush()


def main() -> int:
    """Run slices and count their outcomes."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--first", type=int, default=0, help="number of the first mutation")
    parser.add_argument("--count", type=int, default=1000, help="how many")
    parser.add_argument("--slice", type=int, default=500, help="how many in one process")
    parser.add_argument("--keep", help="write the mutated files here, each over the one before")
    parser.add_argument("--worker", action="store_true", help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.worker:
        work(range(given.first, given.first + given.count), given.keep)
        return 0
    results: list[list] = []
    number, end, started = given.first, given.first + given.count, time.perf_counter()
    while number < end:
        upto = min(number + given.slice, end)
        command = [sys.executable, __file__, "--worker", "--first", str(number), "--count", str(upto - number)]
        command += ["--keep", given.keep] if given.keep else []
        run = subprocess.run(command, capture_output=True, text=True)  # noqa: S603  this very file
        done = [json.loads(line) for line in run.stdout.splitlines()]
        results += done
        number += len(done)
        if number < upto:
            how = signal.Signals(-run.returncode).name if run.returncode < 0 else f"exit {run.returncode}"
            results.append([number, f"BAD: process ended by {how}: {run.stderr.strip()[-100:]}", 0.0, 0])
            number += 1
        print(f"{number - given.first}/{given.count}", file=sys.stderr, flush=True)
    for kind, count in Counter(kind for _, kind, _, _ in results).most_common():
        example = next(n for n, k, _, _ in results if k == kind)
        print(f"{count:7d}  {kind}  (such as {example})")
    slowest, largest = max(results, key=lambda r: r[2]), max(results, key=lambda r: r[3])
    print(
        f"{len(results)} files in {time.perf_counter() - started:.0f} s; longest {slowest[2]:.2f} s (number "
        f"{slowest[0]}), most memory {largest[3] / 1024:.0f} MiB above the idle process"
    )
    return int(any(kind.startswith("BAD") for _, kind, _, _ in results))


if __name__ == "__main__":
    sys.exit(main())
