import json

from rich.console import Console
from typer.testing import CliRunner

from armdyn.cli.doctor import policy_facts, policy_table
from cli.command import app, run_here

ROWS = [
    ("search.starts", 16, "guesses", "fewer miss the best known optimum", "RR, ten payloads"),
    ("same", 1e-06, "-", "two durations nearer than this are one", "all"),
    ("meshes", (10, 20), "intervals", "[in brackets]", "R"),
    ("flat", None, "scaled", "none: IPOPT's own", "RRR"),
]


def test_policy_as_a_table():
    console = Console(width=120)
    with console.capture() as captured:
        console.print(policy_table("rr", ROWS))
    words = " ".join(captured.get().split())
    assert "rr: policy of minimum time" in words
    assert "search.starts 16 guesses fewer miss the best known optimum chosen on: RR, ten payloads" in words
    assert "1e-06" in words and "(10, 20)" in words and "[in brackets]" in words


def test_policy_as_json():
    facts = policy_facts(ROWS)
    assert facts[0] == {
        "name": "search.starts", "value": 16, "unit": "guesses",
        "reason": "fewer miss the best known optimum", "cases": "RR, ten payloads",
    }  # fmt: skip
    assert [fact["value"] for fact in facts] == [16, 1e-06, "(10, 20)", None]
    json.dumps(facts, allow_nan=False)


def run(*arguments):
    done = CliRunner().invoke(app, ["doctor", *arguments, "--json"])
    assert done.exit_code == 0, done.output
    return {row["name"]: row["value"] for row in json.loads(done.stdout)["policy"]}


def test_the_policy_of_a_robot():
    small, large = run("rr", "--policy"), run("panda", "--policy")
    assert small.keys() == large.keys()
    assert (small["strategy.methods"], large["strategy.methods"]) == ("('mesh',)", "('curves',)")
    assert small["search.starts"] == 32
    assert run("--policy") == small  # of the arm that the installation is tried with


def test_limits_have_the_units_of_the_joints():
    heads = [run_here("doctor", name).stdout for name in ("rr", "cart_pole")]
    assert "[rad]" in heads[0] and "[rad or m]" not in heads[0]
    assert "[rad/s or m/s]" in heads[1] and "[N m or N]" in heads[1]
