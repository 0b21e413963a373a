"""Options of the results: their folder and files."""

from __future__ import annotations

import re
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Self

import armdyn as ad
from armdyn.cli import interrupts
from armdyn.cli.invocation import invocation
from armdyn.cli.options.groups import flag, group, option
from armdyn.errors import FileError
from armdyn.files import probe_folder

if TYPE_CHECKING:
    from armdyn.models.scene.obstacles import Obstacle


_ENDINGS = {
    ".csv", ".json", ".yaml", ".yml", ".xml", ".py", ".script", ".npz", ".html", ".toml", ".urdf", ".png", ".pdf",
    ".svg",
}  # fmt: skip
"""Endings of files that commands write: a value of --out with one of them names a file, not a folder."""
ALIKE = {".yaml": ".json", ".yml": ".json"}
"""Endings of which the file is one of the other's, too: JSON is YAML."""


def probed_folder(out: Path | None, default: Path, *files: str) -> Path:
    """Folder of --out, else the default; checked before the work begins.

    Args:
        out: value of --out.
        default: folder without it.
        files: names of the files to be written there.

    Raises:
        FileError: that cannot be written there, or `out` has the name of a file.
        DiskFullError: there is no room.
    """
    if out is not None and out.suffix.lower() in _ENDINGS and not out.is_dir():
        several = f"this command writes {', '.join(files[:3])}{' …' if len(files) > 3 else ''} into the folder of --out"
        raise FileError(out, f"has the name of a file, but {several}: give a folder")
    return probe_folder(default if out is None else out, *files)


def probed_file(out: Path | None, default: Path, name: str) -> Path:
    """File of a command that writes a single one: --out names it by its ending, or else its folder.

    Args:
        out: value of --out.
        default: folder without it.
        name: of the file in a folder.

    Raises:
        FileError: it cannot be written, or its ending is that of another format.
        DiskFullError: there is no room.
    """
    ending = "" if out is None else out.suffix.lower()
    if out is None or ending not in _ENDINGS or out.is_dir():
        return probed_folder(out, default, name) / name
    if (own := Path(name).suffix) not in (ending, ALIKE.get(ending)):
        raise FileError(out, f"ends in {ending}, but a {own} file would be written: give that ending, or a folder")
    return probe_folder(out.parent, out.name) / out.name


@group()
class OutputOptions:
    """Folder of the results."""

    out: Path | None = option(
        "DIR",
        "Folder for the results, by default results/COMMAND-ROBOT; of a command that writes one file also its name.",
    )

    def folder(self, command: str, name: str, files: Iterable[str] = ()) -> Path:
        """The requested folder, else results/COMMAND-ROBOT; see `probed_folder`.

        Args:
            command: its name.
            name: of the robot.
            files: names of the files to be written there.
        """
        return probed_folder(self.out, _usual(command, name), *files)

    def file(self, command: str, name: str, file: str) -> Path:
        """The one file of a command; see `probed_file`. Arguments as of `folder`."""
        return probed_file(self.out, _usual(command, name), file)


def _usual(command: str, name: str) -> Path:
    """Folder of a command's results without --out."""
    slug = re.sub(r"[^\w.-]+", "_", Path(name).stem) or "robot"
    return Path("results") / f"{command}-{slug}"


@group()
class FigureOptions:
    """Folder of the results, and whether there are figures among them."""

    output: OutputOptions
    no_figure: bool = flag("Write no figure.png and figure.pdf: a second or two less.")

    def drawn(self, *names: str) -> list[str]:
        """Files of figures; none with --no-figure."""
        return [f"{name}.{kind}" for name in names for kind in ("png", "pdf") if not self.no_figure]


@dataclass(frozen=True, kw_only=True)
class Written:
    """The files of a motion.

    Attributes:
        files: in the order they were written.
        seconds: that it took [s].
    """

    files: Sequence[Path]
    seconds: float

    def with_files(self, more: Sequence[Path]) -> Self:
        """The results with more files."""
        return replace(self, files=[*self.files, *more])

    @property
    def words(self) -> dict[str, str]:
        """Folder and names of the files, and the time they took, by the label that each is printed under."""
        names = ", ".join(file.name for file in self.files)
        return {"results": str(self.files[0].parent), "written": f"{names} in {self.seconds:.1f} s"}


@group()
class ResultOptions(FigureOptions):
    """Files of one motion, and their folder."""

    no_report: bool = flag("Write no report.html: about a second less.")

    def folder(self, command: str, name: str, motions: Iterable[str] = ("trajectory",)) -> Path:
        """Folder of the files; see `OutputOptions.folder`."""
        from armdyn.show.results import file_names

        return self.output.folder(command, name, file_names(self._parts, motions))

    @property
    def _parts(self) -> list[str]:
        """The requested drawings."""
        return [part for part, left_out in (("figure", self.no_figure), ("report", self.no_report)) if not left_out]

    def write(
        self,
        folder: Path,
        robot: ad.Robot,
        motions: Mapping[str, ad.Trajectory],
        summary: dict[str, object],
        title: str,
        obstacles: Sequence[Obstacle] = (),
        *,
        progress: Callable[[str], None],
    ) -> Written:
        """Write the requested files of motions; see `write_run`. After Ctrl-C nothing is drawn: that takes seconds."""
        from armdyn.show.results import write_run

        begun = time.perf_counter()
        known = {**summary, **invocation()}
        parts = [] if summary.get("status") == "interrupted" else self._parts

        def drawing(text: str) -> None:
            interrupts.saved(f"the motion is saved in {folder}")  # drawing begins when it is
            progress(text)

        files = write_run(folder, robot, motions, known, title, obstacles, parts=parts, progress=drawing)
        return Written(files=files, seconds=time.perf_counter() - begun)
