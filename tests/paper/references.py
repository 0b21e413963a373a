"""Numbers computed independently of armdyn, by payload [kg] and reading."""

import json
from pathlib import Path

from armdyn.paper.printed.examples import PAYLOADS

REFERENCE = json.loads((Path(__file__).parent / "reference.json").read_text())
READINGS = ("tip", "mM")
EVERY = [(payload, reading) for reading in READINGS for payload in PAYLOADS]


def grams(payload):
    return f"{1000 * payload:g}"


def reference(quantity, reading, payload):
    return REFERENCE[quantity][reading][grams(payload)]
