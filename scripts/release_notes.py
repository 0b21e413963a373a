"""The notes of a release: its section of CHANGELOG.md.

python scripts/release_notes.py [VERSION]    # by default the section on top
"""

import re
import sys
from pathlib import Path

CHANGELOG = Path(__file__).parents[1] / "CHANGELOG.md"


def notes(text: str, version: str | None = None) -> str:
    """The section `## [version]`, or the one on top, without its head.

    Raises:
        SystemExit: there is no such section.
    """
    sections = re.split(r"^## \[([^\]]+)\][^\n]*\n", text, flags=re.M)
    found = dict(zip(sections[1::2], sections[2::2], strict=True))
    version = version or next(iter(found))
    if version not in found:
        raise SystemExit(f"{CHANGELOG.name} has no section [{version}]; it has {', '.join(found)}")
    return found[version].strip() + "\n"


if __name__ == "__main__":
    sys.stdout.write(notes(CHANGELOG.read_text(), *sys.argv[1:2]))
