"""Release notes come from CHANGELOG.md."""

import subprocess
import sys
from pathlib import Path

SCRIPT = Path(__file__).parents[2] / "scripts" / "release_notes.py"


def run(*arguments):
    return subprocess.run([sys.executable, str(SCRIPT), *arguments], capture_output=True, text=True)


def test_the_section_on_top():
    done = run()
    assert done.returncode == 0
    assert done.stdout.startswith("### Arms and dynamics") and "## [" not in done.stdout


def test_no_such_version():
    done = run("99.0.0")
    assert done.returncode == 1 and "no section [99.0.0]" in done.stderr and "0.2.0" in done.stderr
