"""The pictures of docs/sweeps.md: figures of its two studies.

sweep_curve.png, sweep_map.png and sweep_pareto.png:

python scripts/sweep_pictures.py
"""

import argparse
import re
import tempfile
from pathlib import Path

import armdyn as ad
from armdyn.show.figures.sweeps import figures_of
from armdyn.studies.settings import label

DOCS = Path(__file__).parents[1] / "docs"
PICTURES = {
    "study": {"curve": "The two-link arm with more and more payload"},
    "motors": {"map": "Stronger motors or faster ones?", "pareto": "Time or torque: 49 pairs of motors"},
}
"""Of each study: the figures that the page shows."""
COUNT = ("duration_s", "torque_squared")


def main():
    """Write docs/sweep_*.png."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, default=DOCS)
    out = parser.parse_args().out
    studies = re.findall(r"```toml\n(.*?)```", (DOCS / "sweeps.md").read_text(), flags=re.S)
    for name, pictures in PICTURES.items():
        text = next(text for text in studies if text.startswith(f"# {name}.toml"))
        with tempfile.TemporaryDirectory() as folder:
            file = Path(folder) / "study.toml"
            file.write_text(text)
            study = ad.read_study(file)
            run = ad.run_study(study, file.with_suffix(".sqlite"))
            rows = ad.study_table(run.file)
        kinds = {axis.name: axis.kind for axis in study.axes}
        print(f"{len(rows)} cases in {run.seconds:.1f} s: {run.counts}")
        for kind, title in pictures.items():
            figures_of(rows, kinds, COUNT, named=label, title=title)[kind].savefig(out / f"sweep_{kind}.png", dpi=110)
            print(out / f"sweep_{kind}.png")


if __name__ == "__main__":
    main()
