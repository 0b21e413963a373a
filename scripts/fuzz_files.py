"""Loads damaged files by the thousand: each must be read or refused by an ArmdynError, in bounded time and memory.

A damage is its number: the same number, the same file. Each kind runs in a process of its own, so that a crash and a
hang are seen.

    scripts/fuzz_files.py --count 10000 --seed 0
    scripts/fuzz_files.py --only json --count 1 --seed 4711    # one of them
"""

import argparse
import importlib
import re
import resource
import signal
import sys
import time
from collections import Counter
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

KINDS = {"trajectories": "damage", "json": "damage", "cache": "damaged_cache"}
"""And the module of the tests that damages them."""
TIME, MEMORY = 20, 2**30  # [s] and [bytes] that a file may take


def work(kind: str, count: int, seed: int) -> tuple[Counter, float, int, int]:
    """Load these damaged files; how they ended, the longest time [s], its number, and the memory above idle [bytes]."""
    fuzz = getattr(importlib.import_module(KINDS[kind]), f"fuzz_{kind}")
    fuzz(1, seed)  # modules and functions that are loaded once
    now = int(re.search(r"VmSize:\s+(\d+)", Path("/proc/self/status").read_text())[1]) * 1024
    resource.setrlimit(resource.RLIMIT_AS, (now + MEMORY, now + MEMORY))
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    ends, longest, which = Counter(), 0.0, seed
    for number in range(seed, seed + count):
        signal.alarm(TIME)  # ends the process
        started = time.perf_counter()
        found = fuzz(1, number)
        taken = time.perf_counter() - started
        signal.alarm(0)
        if any(end.startswith("BAD") for end in found):
            print(f"number {number}: {next(iter(found))}", file=sys.stderr)
        ends += found
        longest, which = max((longest, which), (taken, number))
    return ends, longest, which, 1024 * (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before)


def main() -> int:
    """Count the outcomes of each kind of file."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=10_000, help="how many of each kind")
    parser.add_argument("--seed", type=int, default=0, help="number of the first")
    parser.add_argument("--only", choices=KINDS, help="this kind alone")
    given, bad = parser.parse_args(), False
    for kind in [given.only] if given.only else KINDS:
        with ProcessPoolExecutor(1) as pool:
            try:
                ends, longest, which, peak = pool.submit(work, kind, given.count, given.seed).result()
            except BrokenProcessPool:
                ends, longest, which, peak = Counter({f"BAD: a crash, or more than {TIME} s": 1}), 0.0, given.seed, 0
        print(f"{kind}:")
        for end, count in ends.most_common():
            print(f"{count:7d}  {end}")
        print(f"  {ends.total()} files; longest {longest:.2f} s (number {which}), {peak / 2**20:.0f} MiB above idle")
        bad |= any(end.startswith("BAD") for end in ends)
    return int(bad)


if __name__ == "__main__":
    sys.exit(main())
