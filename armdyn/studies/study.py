"""Study: a task and the settings that vary; each combination is a case."""

import hashlib
import json
import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, Literal

import numpy as np

from armdyn.arguments import Checked, checked, number, one_of, whole
from armdyn.arrays import Array
from armdyn.errors import ProblemError
from armdyn.locks import cached_property
from armdyn.studies.problems import ARM
from armdyn.studies.rows import Value
from armdyn.studies.tasks.task import Neighbours, StudyTask

FORMAT = "armdyn-sweep-1"
MAX_CASES = 10**6
"""Largest study [cases]: their places are kept in memory (docs/cluster.md says how to do more)."""
MAX_AXES = 32

_NEAR = 12
"""Neighbours of a case, at most."""
_SAME_ARM = 10.0
"""Cases farther than that from each other, in ranges, are of other arms."""

Method = Literal["grid", "random", "latin-hypercube"]
METHODS: tuple[Method, ...] = ("grid", "random", "latin-hypercube")
Scale = Literal["linear", "log"]


@dataclass(frozen=True, kw_only=True)
class Axis:
    """Values of one setting: a list, or a range of numbers.

    Attributes:
        name: of the setting.
        values: the list; empty: a range.
        low: least number of the range, in the setting's unit.
        high: greatest number.
        count: numbers of the range in a grid.
        scale: of the range; "log": its numbers have even ratios.
    """

    name: str
    values: tuple[Value, ...] = ()
    low: float = 0.0
    high: float = 0.0
    count: int = 0
    scale: Scale = "linear"

    def __post_init__(self) -> None:
        if self.values:
            if len({json.dumps(value) for value in self.values}) < len(self.values):
                raise ProblemError(f"{self.name} has a value twice")
            return
        number(self.low, f"{self.name}: from")
        number(self.high, f"{self.name}: to")
        whole(self.count, f"{self.name}: count", least=0)
        one_of(self.scale, ("linear", "log"), f"{self.name}: scale")
        if not self.low < self.high:
            raise ProblemError(f"{self.name} goes from {self.low:g} to {self.high:g}; it must go up")
        if self.scale == "log" and self.low <= 0:
            raise ProblemError(f"{self.name} goes from {self.low:g}; a log scale begins above 0")

    @property
    def levels(self) -> int:
        """Number of values in a grid."""
        return len(self.values) or self.count

    @property
    def kind(self) -> Literal["words", "linear", "log"]:
        """Whether the values are words (texts, lists, tables), or numbers on a scale."""
        if not self.values:
            return self.scale
        return "linear" if all(isinstance(one, int | float) for one in self.values) else "words"

    def value(self, place: float) -> Value:
        """Value at a place from 0 to 1; each member of a list has an equal share of that interval."""
        if self.values:
            return self.values[min(int(place * len(self.values)), len(self.values) - 1)]
        ratio = self.high / self.low if self.scale == "log" else 0.0
        value = self.low * ratio**place if ratio else self.low + (self.high - self.low) * place
        return float(f"{value:.12g}")  # 0.08, not 0.08000000000000002

    def places(self) -> Array:
        """Places of the values in a grid, shape (levels,) [-]."""
        n = self.levels
        return (np.arange(n) + 0.5) / n if self.values else np.linspace(0.0, 1.0, n)

    def description(self) -> dict[str, object]:
        """The axis as JSON."""
        if self.values:
            return {"values": list(self.values)}
        return {"from": self.low, "to": self.high, "count": self.count, "scale": self.scale}


class Cases:
    """The cases of a task.

    Attributes:
        task: work to be done in each case.
    """

    task: StudyTask

    def __len__(self) -> int:
        raise NotImplementedError

    def parameters(self, k: int) -> dict[str, Value]:
        """Settings of a case."""
        raise NotImplementedError

    def description(self) -> Mapping[str, object]:
        """All that the rows depend on, as JSON."""
        raise NotImplementedError

    def nearest(self, k: int) -> tuple[int, ...]:
        """Cases whose motion may be the initial guess of case k, nearest first, done or not; none by default."""
        return ()


class OwnTask(Cases):
    """Cases that are their own task."""

    neighbours: ClassVar[Neighbours] = "off"

    @property
    def task(self) -> Any:  # type: ignore[override]
        """The study itself, which is also the task."""
        return self


@dataclass(frozen=True, kw_only=True, eq=False)
class Study(Cases, Checked):
    """Cases of a task whose settings vary along axes.

    Attributes:
        task: work to be done in each case.
        axes: settings that vary.
        method: "grid": all combinations of values, the last axis fastest; "random": each number drawn on its own;
            "latin-hypercube": each axis's range in as many parts as there are cases, one case in each.
        count: number of cases, unless it is a grid.
        seed: of the draws.
    """

    task: StudyTask
    axes: tuple[Axis, ...]
    method: Method = checked(one_of, "grid", known=METHODS)
    count: int = checked(whole, 0, least=0)
    seed: int = checked(whole, 0, least=0)

    def __post_init__(self) -> None:
        super().__post_init__()
        if not self.axes:
            raise ProblemError("nothing varies: give [vary] a setting")
        names = [axis.name for axis in self.axes]
        if len(names) > MAX_AXES or len(set(names)) < len(names):
            raise ProblemError(f"{len(names)} settings vary; at most {MAX_AXES} do, each once")
        if self.method == "grid":
            if self.count:
                raise ProblemError("count: a grid has as many cases as its values make; leave count out")
            for axis in self.axes:
                if not axis.levels:
                    raise ProblemError(f"{axis.name} has a range without count; a grid needs it, 1 or more values")
        if not 1 <= self._cases() <= MAX_CASES:
            count = f"the grid has {self._cases()} cases" if self.method == "grid" else f"count is {self.count}"
            raise ProblemError(f"{count}; a study has 1 to {MAX_CASES} cases")

    def __len__(self) -> int:
        return self._cases()

    def _cases(self) -> int:
        """Number of cases, also where it is too large for `len`."""
        return math.prod(axis.levels for axis in self.axes) if self.method == "grid" else self.count

    @cached_property
    def points(self) -> Array:
        """Places of the cases, shape (cases, axes), each number from 0 to 1."""
        if self.method == "grid":
            meshes = np.meshgrid(*(axis.places() for axis in self.axes), indexing="ij")
            return np.column_stack([mesh.ravel() for mesh in meshes])
        draws = np.random.default_rng(self.seed)
        if self.method == "random":
            return draws.random((self.count, len(self.axes)))
        from scipy.stats import qmc

        return np.asarray(qmc.LatinHypercube(len(self.axes), seed=draws).random(self.count))

    def parameters(self, k: int) -> dict[str, Value]:
        """Settings of a case."""
        return {axis.name: axis.value(place) for axis, place in zip(self.axes, self.points[k], strict=True)}

    def description(self) -> Mapping[str, object]:
        """All that the rows depend on, as JSON; the places by their checksum."""
        return {
            "format": FORMAT,
            "task": self.task.description(),
            "vary": {axis.name: axis.description() for axis in self.axes},
            "sample": {"method": self.method, "count": len(self), "seed": self.seed},
            "places": hashlib.sha256(np.ascontiguousarray(self.points, dtype="<f8").tobytes()).hexdigest(),
        }

    def nearest(self, k: int) -> tuple[int, ...]:
        """Cases of the same arm, the nearest first."""
        tree, count = self._tree, min(_NEAR, len(self) - 1)
        if not count:
            return ()
        distances, numbers = tree.query(tree.data[k], k=count + 1)
        pairs = zip(distances, numbers, strict=True)
        return tuple(int(n) for distance, n in pairs if distance <= _SAME_ARM and int(n) != k)

    @cached_property
    def _tree(self) -> Any:
        """Places of the cases as scipy's tree."""
        from scipy.spatial import cKDTree

        points = self.points.copy()
        for column, axis in enumerate(self.axes):
            if axis.name == ARM:  # so far from each other that no arm's case is another's neighbour
                points[:, column] *= 100 * len(axis.values)
        return cKDTree(points)
