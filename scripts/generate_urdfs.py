"""Write urdf/: the paper's three arms, bare and with each payload of Table 2.

python scripts/generate_urdfs.py            write the files
python scripts/generate_urdfs.py --check    exit 1 and name them if they differ from the generated ones
"""

import argparse
import sys
from pathlib import Path

from armdyn.models import PLANAR_ARMS, ArmSpec, Payload, urdf_from_spec
from armdyn.paper import PAYLOADS

FOLDER = Path(__file__).resolve().parent.parent / "urdf"


def contents() -> dict[str, str]:
    """File name to URDF text, for three arms times eleven loads."""
    files = {}
    for arm in PLANAR_ARMS:
        spec = ArmSpec.paper(arm)
        files[f"{arm}.urdf"] = urdf_from_spec(spec)
        for mass in PAYLOADS:
            files[f"{arm}_{1000 * mass:g}g.urdf"] = urdf_from_spec(spec, Payload(mass=mass))
    return files


def differing(folder: Path, files: dict[str, str]) -> list[str]:
    """Names of files that are missing, that differ, or that should not be there."""
    there = {path.name: path.read_bytes() for path in folder.glob("*.urdf")}
    wanted = {name: text.encode() for name, text in files.items()}
    return sorted(name for name in there | wanted if there.get(name) != wanted.get(name))


def main() -> int:
    """Write or check; the exit code."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--check", action="store_true", help="write nothing; exit 1 if a file differs")
    parser.add_argument("--folder", type=Path, default=FOLDER)
    arguments = parser.parse_args()
    files = contents()
    if arguments.check:
        wrong = differing(arguments.folder, files)
        for name in wrong:
            print(f"differs: {arguments.folder / name}", file=sys.stderr)
        return 1 if wrong else 0
    arguments.folder.mkdir(parents=True, exist_ok=True)
    for name, text in files.items():
        (arguments.folder / name).write_bytes(text.encode())
    print(f"{len(files)} files in {arguments.folder}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
