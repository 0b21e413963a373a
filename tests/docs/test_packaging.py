"""The package has one version and one name in all files."""

import re
import tomllib
from pathlib import Path

ROOT = Path(__file__).parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]


def test_one_version():
    said = {
        "CITATION.cff": r"^version: (\S+)$",
        "packaging/conda/meta.yaml": r'^{% set version = "(\S+)" %}$',
    }
    for file, pattern in said.items():
        assert re.findall(pattern, (ROOT / file).read_text(), flags=re.M) == [PROJECT["version"]], file


def test_the_recipe_is_of_this_project():
    text = (ROOT / "packaging/conda/meta.yaml").read_text()
    assert f"python {PROJECT['requires-python']}" in text
    assert f"license: {PROJECT['license']}" in text and PROJECT["description"] in text


def test_the_image_has_a_python_that_serves():
    least = tuple(map(int, re.search(r">=(\d+)\.(\d+)", PROJECT["requires-python"]).groups()))
    for version in re.findall(r"^FROM python:(\d+)\.(\d+)", (ROOT / "Dockerfile").read_text(), flags=re.M):
        assert tuple(map(int, version)) >= least


def test_a_paper_to_cite():
    text = (ROOT / "CITATION.cff").read_text()
    doi = re.search(r"doi: (\S+)", text)[1]
    assert doi in (ROOT / "README.md").read_text() and doi in (ROOT / "docs/paper.md").read_text()
