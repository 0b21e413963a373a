"""Tables of texts as Markdown and LaTeX, and of values as CSV."""

import csv
import io
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

from armdyn.files import write_whole


@dataclass(frozen=True)
class Grid:
    """A table to print.

    Attributes:
        title: above it.
        header: one text per column.
        body: rows of texts.
        note: below it.
    """

    title: str
    header: tuple[str, ...]
    body: tuple[tuple[str, ...], ...]
    note: str = ""

    def markdown(self) -> str:
        """The table in GitHub's Markdown."""
        lines = [self.header, tuple("---:" for _ in self.header), *self.body]
        table = "\n".join("| " + " | ".join(cell.replace("|", "\\|") for cell in line) + " |" for line in lines)
        return f"**{self.title}**\n\n{table}\n" + (f"\n{self.note}\n" if self.note else "")

    def latex(self) -> str:
        """A table environment that needs no package."""
        lines = [" & ".join(_tex(cell) for cell in line) + r" \\" for line in (self.header, *self.body)]
        return "\n".join(
            [
                r"\begin{table}",
                rf"\caption{{{_tex(self.title)}}}",
                rf"\begin{{tabular}}{{{'r' * len(self.header)}}}",
                r"\hline",
                lines[0],
                r"\hline",
                *lines[1:],
                r"\hline",
                r"\end{tabular}",
                *([rf"\par\smallskip {_tex(self.note)}"] if self.note else []),
                r"\end{table}",
                "",
            ]
        )


def write_grid(folder: Path, name: str, one: Grid) -> list[Path]:
    """Write NAME.md and NAME.tex.

    Args:
        folder: that there is.
        name: of the files.
        one: the table.

    Raises:
        OSError: the folder cannot be written.
    """
    return [
        write_whole(folder / f"{name}.md", one.markdown().encode()),
        write_whole(folder / f"{name}.tex", one.latex().encode()),
    ]


def csv_text(lines: Iterable[Sequence[object]]) -> str:
    """Lines of cells as CSV, numbers in full precision; an empty cell is a missing one."""
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows([_cell(cell) for cell in line] for line in lines)
    return text.getvalue()


def _cell(value: object) -> object:
    """Cell of a CSV, in which numbers are as Python prints them."""
    return "" if value is None else repr(float(value)) if isinstance(value, float) else value


def _tex(text: str) -> str:
    for plain, tex in {
        "_": r"\_", "%": r"\%", "√|r|": r"$\sqrt{|r|}$", "±": r"$\pm$", "✓": r"$\surd$", "≈": r"$\approx$",
        "✗": r"$\times$", "–": "--", "π": r"$\pi$", "τ": r"$\tau$", "θ": r"$\theta$",
    }.items():  # fmt: skip
        text = text.replace(plain, tex)
    return text
