"""Motions among shelves, boxes and tables: the problems of MotionBenchMaker (Chamzas et al., RA-L 2022), docs/cells.md.

A folder of problems holds one folder for each set, such as box_panda, with request0001.yaml and scene0001.yaml. Each
problem is solved as a user would: real geometry, self-collision, a clearance of 1 mm; fingers may touch the held part
at the goal. A motion is then sampled at 5,000 times, and its distances are computed by coal on the meshes of the URDF
as they are, which the solver does not use: it takes convex parts. CPU seconds are those of all threads and processes;
an arm's functions are built before. Rows are kept in --out as they come: a run that was ended goes on where
it stopped, with --again, too.

    scripts/clutter.py problems --sets box_panda cage_panda --last 20 --out rows.jsonl
    scripts/clutter.py --table rows.jsonl
    scripts/clutter.py problems --again rows.jsonl --some 100 --seed 3 --busy 2 --out again.jsonl  # the same durations?
"""

import argparse
import json
import resource
import statistics
import subprocess
import sys
import time
from collections.abc import Collection, Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import Any

import coal
import numpy as np
import pinocchio as pin
import yaml

import armdyn as ad
from armdyn.codegen.background import is_building

CLEARANCE = 1e-3
SAMPLES = 5_000
GRASPING = ("finger", "hand")
ARMS = {"panda": {"lock": {"panda_finger_joint1": 0.04, "panda_finger_joint2": 0.04}}, "ur5": {}}


@cache
def arm(name: str) -> ad.Robot:
    """An arm of example-robot-data; the Panda's fingers are locked, nearly open."""
    return ad.Robot.from_library(name, **ARMS[name])


def problem_of(folder: Path, name: str, k: int) -> ad.MinimumTimeProblem:
    """Problem number k of a set."""
    robot = arm(name.rsplit("_", 1)[1])
    request = yaml.load((folder / name / f"request{k:04d}.yaml").read_text(), yaml.CSafeLoader)
    obstacles = ad.load_scene(folder / name / f"scene{k:04d}.yaml").obstacles
    state = request["start_state"]["joint_state"]
    start = dict(zip(state["name"], state["position"], strict=True))
    goal = {one["joint_name"]: one["position"] for one in request["goal_constraints"][0]["joint_constraints"]}
    poses = [[pose[joint] for joint in robot.joint_names] for pose in (start, goal)]
    return ad.MinimumTimeProblem(
        robot,
        q_start=poses[0],
        q_goal=poses[1],
        obstacles=obstacles,
        self_collision=True,
        clearance=CLEARANCE,
        allowed_contacts=held(robot, obstacles, np.array(poses[1])),
    )


def held(robot: ad.Robot, obstacles: tuple[Any, ...], goal: np.ndarray) -> list[tuple[str, str]]:
    """Pairs of the gripper's links and the held part, nearer at the goal than the clearance."""
    model = Meshes(robot, obstacles)
    near = model.distances(goal, np.array([any(part in link for part in GRASPING) for link, _ in model.names]))
    return sorted({model.names[k] for k in np.flatnonzero(near <= CLEARANCE)})


class Meshes:
    """Distances from obstacles, and of links from each other, on the URDF's meshes as Pinocchio reads them."""

    def __init__(self, robot: ad.Robot, obstacles: tuple[Any, ...], links_apart: Collection[tuple[str, str]] = ()):
        self.robot, self.data = robot, robot.model.createData()
        kind, folders = pin.GeometryType.COLLISION, list(robot.package_dirs)
        self.model = pin.buildGeomFromUrdfString(robot.model, robot.urdf, kind, None, folders)
        links = [solid.name.rsplit("_", 1)[0] for solid in self.model.geometryObjects]
        for k, obstacle in enumerate(obstacles):
            at, shape = solid_of(obstacle)
            self.model.addGeometryObject(pin.GeometryObject(f"obstacle {k}", 0, at, shape))
        solids = list(self.model.geometryObjects)
        self.pairs = [
            (i, j) for i in range(len(links)) if solids[i].parentJoint for j in range(len(links), len(solids))
        ]
        own = {frozenset(pair) for pair in links_apart}
        self.pairs += [(i, j) for j in range(len(links)) for i in range(j) if frozenset((links[i], links[j])) in own]
        names = [*links, *(obstacle.name for obstacle in obstacles)]
        self.names = [(names[i], names[j]) for i, j in self.pairs]
        for solid in solids:
            solid.geometry.computeLocalAABB()
        boxes = [solid.geometry.aabb_local for solid in solids]
        self.middles = np.array([(np.array(box.min_) + box.max_) / 2 for box in boxes])
        self.halves = np.array([(np.array(box.max_) - box.min_) / 2 for box in boxes])
        self.hulls = [hull_of(solid.geometry) for solid in solids]
        self.geometry = pin.GeometryData(self.model)

    def place(self, q: np.ndarray) -> None:
        """Place the solids."""
        pin.updateGeometryPlacements(
            self.robot.model, self.data, self.model, self.geometry, self.robot.configuration(q)
        )

    def bounds(self, poses: np.ndarray) -> np.ndarray:
        """Lower bounds on all distances [m], shape (poses, pairs): balls around first solids, boxes around second."""
        frames = np.empty((len(poses), len(self.halves), 3, 4))
        for here, q in zip(frames, poses, strict=True):
            self.place(q)
            for k, place in enumerate(self.geometry.oMg):
                here[k, :, :3], here[k, :, 3] = place.rotation, place.translation
        first, second = np.array(self.pairs).T
        centers = np.einsum("pkij,kj->pki", frames[..., :3], self.middles) + frames[..., 3]
        away = np.einsum("pkji,pkj->pki", frames[:, second, :, :3], centers[:, first] - centers[:, second])
        beyond = np.maximum(np.abs(away) - self.halves[second], 0)
        return np.linalg.norm(beyond, axis=-1) - np.linalg.norm(self.halves, axis=-1)[first]

    def distance(self, k: int, below: float = np.inf) -> float:
        """Distance of a pair where the solids are [m]; a lower bound if that is not below a distance."""
        (i, j), places, solids = self.pairs[k], self.geometry.oMg, self.model.geometryObjects
        out = np.inf
        for a, b in ((self.hulls[i], self.hulls[j]), (solids[i].geometry, solids[j].geometry)):
            result, at = coal.DistanceResult(), (to_coal(places[i]), to_coal(places[j]))
            out = float(coal.distance(a, at[0], b, at[1], coal.DistanceRequest(), result))
            if out >= below:
                break
        return out

    def distances(self, q: np.ndarray, which: np.ndarray) -> np.ndarray:
        """Distances of some pairs at joint positions q [m]; infinite for the others."""
        self.place(q)
        return np.array([self.distance(k) if which[k] else np.inf for k in range(len(self.pairs))])

    def least(self, motion: ad.Trajectory, allowed: tuple[tuple[str, str], ...]) -> float:
        """Least distance of pairs that may not touch at even times of a motion [m]."""
        least, kept = np.inf, np.array([name not in set(allowed) for name in self.names])
        poses = motion(np.linspace(motion.t[0], motion.t[-1], SAMPLES)).q
        bounds = np.vstack([np.where(kept, self.bounds(part), np.inf) for part in np.array_split(poses, 10)])
        for m in np.argsort(np.min(bounds, axis=1)):
            near = np.flatnonzero(bounds[m] < least)
            if near.size:
                self.place(poses[m])
            for k in near[np.argsort(bounds[m, near])]:
                if bounds[m, k] < least:
                    least = min(least, self.distance(int(k), least))
        return float(least)


def solid_of(obstacle: ad.Box | ad.Cylinder) -> tuple[pin.SE3, Any]:
    """Placement and geometry of an obstacle, from its numbers."""
    if isinstance(obstacle, ad.Box):
        return pin.SE3(np.array(obstacle.placement)), coal.Box(*obstacle.size)
    a, b = np.array(obstacle.a), np.array(obstacle.b)
    turn = pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), b - a).matrix()
    return pin.SE3(turn, (a + b) / 2), coal.Cylinder(obstacle.radius, float(np.linalg.norm(b - a)))


def hull_of(geometry: Any) -> Any:
    """A mesh's convex hull; another solid itself."""
    if not isinstance(geometry, coal.BVHModelBase):
        return geometry
    geometry.buildConvexHull(True, "Qt")
    return geometry.convex


def to_coal(place: pin.SE3) -> coal.Transform3s:
    """A placement, as coal takes it."""
    return coal.Transform3s(place.rotation, place.translation)


def cpu() -> float:
    """CPU seconds of this process and of those that ended under it."""
    return sum(
        used.ru_utime + used.ru_stime
        for used in map(resource.getrusage, (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    )


def solved(folder: Path, name: str, k: int) -> dict[str, Any]:
    """Solve one problem; its row."""
    row: dict[str, Any] = {"set": name, "problem": k}
    try:
        problem = problem_of(folder, name, k)
        while is_building():  # a compiler that the last problem has begun would count here
            time.sleep(0.1)
        before, started = cpu(), time.perf_counter()
        solution = ad.solve_minimum_time(problem)
    except ad.ArmdynError as error:
        return row | {"usable": False, "why": str(error)}
    row |= {"cpu": cpu() - before, "wall": time.perf_counter() - started}
    clearance = solution.clearance
    row |= {"status": solution.status.name, "usable": solution.usable, "duration": solution.duration}
    row |= {"bound": solution.lower_bound, "sure": clearance is not None and clearance.sure}
    if not solution.usable:
        row["why"] = solution.message
    free = ad.solve_minimum_time(problem.without_obstacles(), ad.MinimumTimeOptions(calm=0))
    row["free"] = free.duration if free.usable else None
    if solution.usable:
        model = Meshes(problem.robot, problem.obstacles, problem.collision_model().pairs)
        row["sampled"] = model.least(solution.trajectory, problem.allowed_contacts)
    return row


def run(given: argparse.Namespace) -> None:
    """Solve the problems without a row in --out."""
    rows = lines(given.out) if given.out.exists() else []
    done = {(row["set"], row["problem"]) for row in rows}
    todo = [(name, k) for k in range(given.first, given.last + 1) for name in given.sets if (name, k) not in done]
    for one in {name.rsplit("_", 1)[1]: (name, k) for name, k in todo}.values():
        solved(given.folder, *one)  # builds the functions of later solves
    with given.out.open("a") as out:
        for name, k in todo:
            row = solved(given.folder, name, k)
            out.write(json.dumps(row) + "\n")
            out.flush()
            print(f"{name} {k}: {said(row)}", file=sys.stderr)


def said(row: dict[str, Any]) -> str:
    """A row in words."""
    if not row["usable"]:
        return str(row["why"])
    ratios = [f"{row['duration'] / row[key]:.3f} times the {key}" for key in ("free", "bound") if row[key]]
    return ", ".join([f"{row['duration']:.4f} s", *ratios, f"CPU {row['cpu']:.2f} s"])


def again(given: argparse.Namespace) -> None:
    """Solve some problems again, with busy processes in parallel, and compare the durations; skips those in --out."""
    rows = [row for row in lines(given.again) if row["usable"]]
    chosen = np.random.default_rng(given.seed).choice(len(rows), min(given.some, len(rows)), replace=False)
    known = {(row["set"], row["problem"]): row["again"] for row in lines(given.out)} if given.out.exists() else {}
    with busy(given.busy), given.out.open("a") as out:
        for row in (rows[k] for k in chosen if (rows[k]["set"], rows[k]["problem"]) not in known):
            name, number = row["set"], row["problem"]
            known[name, number] = ad.solve_minimum_time(problem_of(given.folder, name, number)).duration
            out.write(json.dumps({"set": name, "problem": number, "again": known[name, number]}) + "\n")
            out.flush()
            print(f"{name} {number}: {row['duration']:.6f} s, again {known[name, number]:.6f} s", file=sys.stderr)
    changes = [abs(known[rows[k]["set"], rows[k]["problem"]] / rows[k]["duration"] - 1) for k in chosen]
    print(f"largest relative difference of {len(changes)} durations: {max(changes):.1e}")


@contextmanager
def busy(count: int) -> Iterator[None]:
    """Keep a number of processes busy meanwhile."""
    others = [subprocess.Popen([sys.executable, "-c", "while True: pass"]) for _ in range(count)]
    try:
        yield
    finally:
        for other in others:
            other.kill()
            other.wait()


def lines(path: Path) -> list[dict[str, Any]]:
    """Rows of a file."""
    return [json.loads(line) for line in path.read_text().splitlines()]


def table(rows: list[dict[str, Any]]) -> str:
    """A row for each set and one for each arm, then the failures."""
    out = [
        "| set | usable | time: mean, 98 % [s] | to free: median, worst | to bound: median, worst "
        "| CPU: median, 95 %, worst [s] | least distance [mm] |",
        "|---|---|---|---|---|---|---|",
    ]
    names = sorted({row["set"] for row in rows}, key=lambda name: name.rsplit("_", 1)[::-1])
    groups = [(name, [row for row in rows if row["set"] == name]) for name in names]
    arms = sorted({name.rsplit("_", 1)[1] for name in names})
    groups += [(f"all of {one}", [row for row in rows if row["set"].endswith(f"_{one}")]) for one in arms]
    for name, group in groups:
        good = [row for row in group if row["usable"]]
        if not good:
            out.append(f"| {name} | 0 of {len(group)} | | | | | |")
            continue
        times, cpus = [row["duration"] for row in good], [row["cpu"] for row in group if "cpu" in row]
        ratios = [row["duration"] / row["free"] for row in good if row["free"]]
        gaps = [row["duration"] / row["bound"] for row in good if row["bound"]]
        out.append(
            f"| {name} | {len(good)} of {len(group)} | {statistics.mean(times):.3f}, {np.percentile(times, 98):.2f} | "
            f"{statistics.median(ratios):.3f}, {max(ratios):.2f} | {statistics.median(gaps):.4f}, {max(gaps):.2f} | "
            f"{statistics.median(cpus):.2f}, {np.percentile(cpus, 95):.2f}, {max(cpus):.2f} | "
            f"{1e3 * min(row['sampled'] for row in good):.2f} |"
        )
    failures = [f"- {row['set']} {row['problem']}: {row['why']}" for row in rows if not row["usable"]]
    return "\n".join([*out, "", *failures])


def main() -> None:
    """Read the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", nargs="?", type=Path, help="of problems: a folder for each set")
    parser.add_argument("--sets", nargs="+", metavar="SET", help="such as box_panda; all by default")
    parser.add_argument("--first", type=int, default=1, help="problem of each set (1)")
    parser.add_argument("--last", type=int, default=60, help="problem of each set (60)")
    parser.add_argument("--out", type=Path, help="rows, kept as they come (clutter.jsonl; of --again again.jsonl)")
    parser.add_argument("--table", type=Path, metavar="ROWS", help="print the table of rows")
    parser.add_argument("--again", type=Path, metavar="ROWS", help="solve some of them again and compare")
    parser.add_argument("--some", type=int, default=100, help="how many of --again (100)")
    parser.add_argument("--seed", type=int, default=0, help="of the choice of --again (0)")
    parser.add_argument("--busy", type=int, default=0, help="busy processes in parallel with --again (0)")
    given = parser.parse_args()
    given.out = given.out or Path("again.jsonl" if given.again else "clutter.jsonl")
    if given.table:
        print(table(lines(given.table)))
        return
    if given.folder is None:
        parser.error("name the folder of problems, or --table ROWS")
    given.sets = given.sets or sorted(path.name for path in given.folder.iterdir() if path.is_dir())
    (again if given.again else run)(given)


if __name__ == "__main__":
    main()
