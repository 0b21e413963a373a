import json
from dataclasses import field

import pytest
import typer
from typer.testing import CliRunner

from armdyn.cli.console import Answer
from armdyn.cli.options.groups import argument, flag, group, option, with_options


@group("How")
class Speed:
    speed: float = option("V", "How fast.", default=1.0)
    backwards: bool = flag("The other way.")


@group()
class Ride:
    name: str = argument("NAME", "")
    speed: Speed = field(default_factory=Speed)
    stop: list[str] | None = option("S", "On the way.")


def ride(ride: Ride, loud: bool = flag("")) -> Answer:
    """A ride in a docstring
    of two lines.

    Another paragraph
    of two lines.

    [dim]ride a
    ride b[/]
    """
    speed = ride.speed
    typer.echo(json.dumps([ride.name, speed.speed, speed.backwards, ride.stop, loud]))
    return Answer()


@pytest.fixture
def run():
    app = typer.Typer(rich_markup_mode="rich")
    app.command()(with_options(ride))
    return lambda *arguments: CliRunner().invoke(app, list(arguments), env={"COLUMNS": "80"})


def test_options_of_nested_groups_arrive_in_them(run):
    assert json.loads(run("x").stdout) == ["x", 1.0, False, None, False]
    given = run("x", "--speed", "2", "--backwards", "--stop", "a", "--stop", "b", "--loud")
    assert json.loads(given.stdout) == ["x", 2.0, True, ["a", "b"], True]


def test_a_required_argument_is_required(run):
    assert run().exit_code == 2


def test_help_has_a_panel_for_each_group_and_flows(run):
    lines = run("--help").stdout.splitlines()
    assert any("─ How ─" in line for line in lines)
    flag = next(line for line in lines if "--backwards" in line)
    assert "bool" not in flag.lower()
    assert any("Another paragraph of two lines." in line for line in lines)
    assert any(line.strip() == "ride a" for line in lines)


def test_two_groups_with_one_option_are_a_mistake():
    def twice(one: Speed, two: Speed) -> Answer: ...

    with pytest.raises(TypeError, match="two options 'speed'"):
        with_options(twice)


def test_a_group_can_be_made_without_a_command_line():
    assert Ride(name="x").speed == Speed()
