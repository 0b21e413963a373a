"""Study task "cycle": a cycle file whose numbers vary."""

import copy
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, ClassVar, Self

from armdyn.arguments import shown
from armdyn.cycle.cycle_files import OPTIONS, TABLES, cycle_from, keys_of
from armdyn.cycle.solve import solve_cycle
from armdyn.errors import ProblemError, did_you_mean
from armdyn.files import file_inside
from armdyn.models.robots.poses import positions_of
from armdyn.models.tables import robot_from, robot_table
from armdyn.optimal import MinimumTimeOptions
from armdyn.optimal.verify.optimum import torque_squared
from armdyn.parsing.toml import Table, read_toml
from armdyn.studies.problems import place_of, with_checksum, with_scene, without_files
from armdyn.studies.rows import Value
from armdyn.studies.tasks.minimum_time import result_with
from armdyn.studies.tasks.task import CaseResult, Neighbours


@dataclass(frozen=True, kw_only=True)
class CycleTask:
    """Fastest cycle of every case.

    Attributes:
        file: of the cycle.
        tables: of the file, with the contents of all files that it names, so that workers need none.
        options: of every solve, each in one process.
    """

    name: ClassVar = "cycle"
    outcomes: ClassVar = ("duration_s", "torque_squared")
    neighbours: ClassVar[Neighbours] = "off"

    file: str
    tables: Mapping[str, Any]
    options: MinimumTimeOptions = field(default_factory=MinimumTimeOptions)

    @classmethod
    def read(cls, table: Table) -> Self:
        """The task that a table [cycle] of a study file describes.

        Raises:
            ProblemError: the table, or the cycle file that it names, describes none.
        """
        table.only(("file", *OPTIONS))
        if "file" not in table.values:
            raise table.error("file", 'cycle.file is missing: a cycle file next to the study, such as "cell.toml"')
        with table.at("file"):
            path = file_inside(Path(table.path).parent, table.values["file"])
        own = without_files(read_toml(path))
        own.only(TABLES)
        robot = robot_from(own.table("robot"))
        cycle_from(own, robot)
        given = {key: value for key, value in table.values.items() if key != "file"}
        with table.locating_errors():
            options = MinimumTimeOptions(**{**own.table("options").values, **given})
        tables = {key: value for key, value in own.values.items() if key != "options"}
        conditions = own.table("cycle")
        tables |= {"robot": robot_table(robot), "cycle": with_scene(conditions.values, conditions, robot)}
        return cls(file=str(path), tables=tables, options=options)

    def checked(self, name: str, value: Any) -> Value:
        """A setting's value, if there is such a place in the cycle file.

        Raises:
            ProblemError: there is no cycle file.
        """
        if name.partition(".")[0] not in self.tables:
            raise ProblemError(f"{name} is no setting of a cycle: its way begins with {', '.join(self.tables)}")
        place, key = place_of(copy.deepcopy(dict(self.tables)), name, ())
        known = keys_of(place) if isinstance(place, dict) else ()
        if known and key not in known:
            raise ProblemError(f"{name}: a {known[0]} has no {key!r}{did_you_mean(key, known)}")
        if isinstance(value, str):
            self._check_name(name, key, place, value)
        return value

    def _check_name(self, name: str, key: Any, place: object, value: str) -> None:
        """Refuse the name of a pose or part that there is not: once, not in every row."""
        if key in ("grasp", "release") and value not in (parts := self.tables.get("parts", {})):
            raise ProblemError(f"{name} is {shown(value)}; it is a part of [parts]{did_you_mean(value, parts)}")
        if key in ("start", "to") or (isinstance(place, list) and name.split(".")[-2] == "via"):
            positions_of(robot_from(Table(self.file, dict(self.tables["robot"]), None)), value, name)

    def work(self, settings: Mapping[str, Value], guess: bytes, revisit: bool = False) -> CaseResult:
        """Solve the cycle of a case."""
        values = copy.deepcopy(dict(self.tables))
        for name, value in settings.items():
            place, key = place_of(values, name, ())
            place[key] = value
        table = Table(self.file, values, None)
        cycle = cycle_from(table, robot_from(table.table("robot")))
        solution = solve_cycle(cycle, replace(self.options, workers=1))
        most = next(iter(solution.decides), None)
        facts = {
            "duration_s": solution.duration if solution.usable else None,
            "gap": solution.gap,
            "lower_bound_s": solution.lower_bound,
            "limited_most_by": most[0] if most else None,
            "torque_squared": torque_squared(solution.trajectory) if solution.usable else None,
            **{f"step_{leg.leg.step}_s": leg.duration for leg in solution.legs if solution.usable},
        }
        return result_with(solution, facts)

    def description(self) -> dict[str, object]:
        """The task as JSON; the text of the robot's file by its checksum."""
        robot = with_checksum(self.tables["robot"])
        options = {name: getattr(self.options, name) for name in OPTIONS}
        return {"task": self.name, "cycle": {**self.tables, "robot": robot}, "search": options}
