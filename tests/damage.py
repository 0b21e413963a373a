"""Files made wrong: a damage is its number, and the same number is the same file."""

import io
import json
import random
import re
import tempfile
import warnings
import zipfile
from collections import Counter
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path

import numpy as np

from armdyn.errors import ArmdynError
from armdyn.models.scene.obstacles import load_obstacles
from armdyn.paper.outcomes import store
from armdyn.paper.outcomes.case import Case
from armdyn.paper.outcomes.run import run_case
from armdyn.show.results import load_result, save_result
from armdyn.trajectory import Trajectory
from mutations import cut, flip, recode, repeat, zeros

CASE = Case(4, "r", "pid", 0.1006)
ARRAYS = ("t", "q", "v", "tau")
BYTES = (flip, flip, cut, repeat, recode, zeros)


def fuzz_trajectories(count: int, seed: int) -> Counter[str]:
    """Load damaged npz files; how many came to which end, those that must not be as BAD."""
    return _ends(damaged_trajectories(count, seed), _load_trajectory)


def fuzz_json(count: int, seed: int) -> Counter[str]:
    """Load damaged result, obstacle and case files; how many came to which end, those that must not be as BAD."""
    return _ends(damaged_json(count, seed), _load_json)


def _ends(files: Iterator[tuple[str, bytes]], load: Callable[[Path, str], str]) -> Counter[str]:
    ends: Counter[str] = Counter()
    with tempfile.TemporaryDirectory() as folder, warnings.catch_warnings():
        warnings.simplefilter("error", RuntimeWarning)  # numpy's, of a number that is none
        for name, data in files:
            path = Path(folder) / name
            path.write_bytes(data)
            try:
                end = load(path, name)
            except ArmdynError as error:
                words = str(error).split(f"{path}", 1)[-1].split(", obstacle ", 1)[-1]
                words = re.split(r"(?<=in units) | is |['\"(\[{]", re.sub(r"^\d+: ", "", words))[0][:60].strip(": ")
                end = f"{type(error).__name__}: {words}" if len(str(error)) < 2000 else "BAD: an endless message"
            except Exception as error:
                end = f"BAD: {type(error).__name__}: {str(error)[:80]}"
            ends[end] += 1
    return ends


def _load_trajectory(path: Path, _: str) -> str:
    motion = Trajectory.load(path)
    f"{motion.name}{motion.model_hash}{''.join(motion.joint_names)}".encode()
    finite = all(np.all(np.isfinite(getattr(motion, name))) for name in ARRAYS)
    return "read" if finite and motion.duration > 0 else "BAD: read, not finite"


def _load_json(path: Path, name: str) -> str:
    if name == "result.json":
        load_result(path)
        return "a result read"
    if name == "obstacles.json":
        load_obstacles(path)
        return "obstacles read"
    path.with_suffix(".npz").write_bytes(_case_files()[1])
    found = store.load_outcome(path.parent, CASE)
    if found is None:
        return "a case to be solved again"
    return "a case read" if found.facts == _outcome().facts else "a case read, of other numbers but well sealed"


@cache
def _outcome():
    return run_case(CASE)


@cache
def _case_files() -> tuple[bytes, bytes]:
    """The JSON and the npz file of a case."""
    with tempfile.TemporaryDirectory() as folder:
        path = store.save_outcome(Path(folder), _outcome())
        return path.read_bytes(), path.with_suffix(".npz").read_bytes()


@cache
def _good_json() -> tuple[tuple[str, bytes], ...]:
    with tempfile.TemporaryDirectory() as folder:
        facts = {"duration": 0.2, "certified": True, "arcs": [{"duration": 0.1, "modes": ["max", "min"]}], "gap": None}
        result = save_result(Path(folder) / "result.json", CASE.robot(), facts).read_bytes()
    obstacles = [
        {"type": "sphere", "center": [0.3, 0, 0.1], "radius": 0.05},
        {"type": "capsule", "a": [0, 0, 0.1], "b": [0, 0, 1], "radius": 0.05, "name": "post"},
        {"type": "box", "size": [1, 1, 0.1], "position": [0, 0, -1], "rpy": [0, 0.1, 0]},
        {"type": "box", "size": [1, 1, 0.1], "position": [0, 0, -2], "quaternion": [0, 0, 0, 1]},
    ]
    return (
        ("result.json", result),
        ("obstacles.json", json.dumps(obstacles).encode()),
        (f"{CASE.name}.json", _case_files()[0]),
    )


def damaged_json(count: int, seed: int) -> Iterator[tuple[str, bytes]]:
    """Names and contents of JSON files that each have something wrong with them."""
    for number in range(seed, seed + count):
        rng = random.Random(number)
        name, data = rng.choice(_good_json())
        if rng.random() < 0.7:
            content = json.loads(data)
            for _ in range(rng.choice((1, 1, 1, 3))):
                _change(content, rng)
            if name.startswith("example") and rng.random() < 0.8:  # with a valid seal
                _seal(content)
            data = json.dumps(content).encode("utf-8", "surrogatepass")
        else:
            data = rng.choice(BYTES)(data, rng)
        yield name, data.replace(b'"@huge"', rng.choice((b"1e400", b"-1e999", b"9" * 400, b"9" * 9000)))


def _change(content: object, rng: random.Random) -> None:
    """One value in a tree of lists and objects becomes another, goes, or comes."""
    holders = [content]
    for holder in holders:
        inside = holder.values() if isinstance(holder, dict) else holder
        holders += [one for one in inside if isinstance(one, dict | list) and one]
    holder = rng.choice([one for one in holders if one] or [[0]])
    key = rng.choice(sorted(holder) if isinstance(holder, dict) else range(len(holder)))
    what = rng.random()
    if what < 0.65:
        holder[key] = _nasty(rng)
    elif what < 0.8:
        del holder[key]
    elif isinstance(holder, dict):
        holder[rng.choice(["more", "", "units", "a" * 10_000, "\ud800"])] = _nasty(rng)
    else:
        holder.append(_nasty(rng))


def _nasty(rng: random.Random) -> object:
    return rng.choice([
        None, True, False, 0, -1, 1.5, 1e308, -1e308, 5e-324, float("nan"), float("inf"), -float("inf"), "@huge",
        10**300, "", "x", "1", "nan", "\ud800", "\0", "Ω" * 50, "x" * 100_000, "interrupted", [], {}, [None], ["x"],
        [[]], [1, 2, 3], [True] * 3, {"x": 1}, [0] * 10_000, [[0.0, 0.0], 1], {"type": []}, "sphere",
    ])  # fmt: skip


def _seal(content: object) -> None:
    if isinstance(content, dict):
        content.pop("digest", None)
        motion = _outcome().trajectory if content.get("trajectory") is True else None
        try:
            content["digest"] = store._digest(content, motion)
        except (ValueError, TypeError):
            content["digest"] = ""


def damaged_trajectories(count: int, seed: int) -> Iterator[tuple[str, bytes]]:
    """Names and contents of npz files that each have something wrong with them, many with checksums that are right."""
    for number in range(seed, seed + count):
        rng = random.Random(number)
        members = _members()
        for name in rng.sample(sorted(members), rng.choice((0, 1, 1, 2))):
            members[name] = rng.choice((_other_array, _other_array, _other_head, _other_bytes))(members[name], rng)
        if rng.random() < 0.1:
            del members[rng.choice(sorted(members))]
        if rng.random() < 0.1:
            members[rng.choice(["more.npy", "../x.npy", "t", "\ud7ff.npy", "a" * 60_000])] = b"x"
        data = _zipped(members, rng)
        yield "motion.npz", rng.choice(BYTES)(data, rng) if rng.random() < 0.4 else data


def _members() -> dict[str, bytes]:
    with zipfile.ZipFile(io.BytesIO(_case_files()[1])) as file:
        return {name: file.read(name) for name in file.namelist()}


def _zipped(members: dict[str, bytes], rng: random.Random) -> bytes:
    content = io.BytesIO()
    how = rng.choice([*[zipfile.ZIP_DEFLATED, zipfile.ZIP_STORED] * 5, zipfile.ZIP_BZIP2, zipfile.ZIP_LZMA])
    with zipfile.ZipFile(content, "w", how) as file:
        for name, data in members.items():
            file.writestr(name, data)
    return content.getvalue()


def _npy(array: np.ndarray) -> bytes:
    content = io.BytesIO()
    np.lib.format.write_array(content, array, allow_pickle=True)
    return content.getvalue()


def _other_array(data: bytes, rng: random.Random) -> bytes:
    """The array, or another one, of another type, shape or with another number."""
    array = np.lib.format.read_array(io.BytesIO(data))
    if array.dtype.kind == "f" and array.size and rng.random() < 0.6:
        with np.errstate(all="ignore"):
            array.flat[rng.randrange(array.size)] = rng.choice([np.nan, np.inf, -np.inf, 1e308, -1e308, 5e-324, 0, 1e9])
            return _npy(
                rng.choice((array, array[::-1], array * 10.0 ** rng.uniform(-300, 300), array[: rng.randrange(3)]))
            )
    if array.dtype.kind == "U" and rng.random() < 0.3:
        return _npy(np.full(array.shape, rng.choice(["\ud800", "\0", "x" * 100_000, "<script>", "Ω"])))
    types = ["f2", "f4", ">f8", "g", "c16", "i8", "u1", "?", "S3", "U3", "M8[s]", "m8[s]", "O", "V5", [("a", "f8")]]
    shapes = [(), (0,), (1,), (2,), (0, 0), (array.size,), (2, 1), (1, 2), (2, 2, 2), (1,) * 20]
    return _npy(np.zeros(rng.choice(shapes), rng.choice(types)))


def _other_head(data: bytes, rng: random.Random) -> bytes:
    """The numbers, under a head that says something else of them."""
    head = rng.choice([
        "", "{}", "[]", "1", "{'descr': '<f8'}", "(" * 5000, "__import__('os').abort()", "\0" * 100, "é",
        *(f"{{'descr': '<f8', 'fortran_order': False, 'shape': ({n},), }}" for n in ("-1", "2.5", "10**12", "9" * 30)),
        "{'descr': '<f8', 'fortran_order': 3, 'shape': 'ab', }",
        *(f"{{'descr': '<f{n}', 'fortran_order': True, 'shape': (1000000000000, 1), }}" for n in "048"),
        "{'descr': '|O', 'fortran_order': False, 'shape': (2,), }",
        "{'descr': '<U99999999', 'fortran_order': False, 'shape': (), }",
    ]).encode()  # fmt: skip
    version = rng.choice((1, 1, 2, 3, 9))
    length = rng.choice((len(head), len(head), 0, 65535)).to_bytes(2 if version == 1 else 4, "little")
    return b"\x93NUMPY" + bytes((version, 0)) + length + head + data[128:]


def _other_bytes(data: bytes, rng: random.Random) -> bytes:
    return rng.choice(BYTES)(data, rng) if data else data
