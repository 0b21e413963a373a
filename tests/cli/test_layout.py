"""Help fits 80 columns without narrow ones, in panels."""

import re
from functools import cache

import pytest
from typer.main import get_command
from typer.testing import CliRunner

from armdyn.cli.console import Terminal, table
from armdyn.cli.help_page import place
from cli.command import app

COMMANDS = [command.callback.__name__.replace("_", "-") for command in app.registered_commands]


@cache
def help_of(*words, columns=80):
    return CliRunner().invoke(app, [*words, "--help"], prog_name="armdyn", env={"COLUMNS": str(columns)}).stdout


@pytest.mark.parametrize("command", COMMANDS)
def test_descriptions_have_most_of_eighty_columns(command):
    lines = help_of(command).splitlines()
    assert max(map(len, lines)) <= 80
    for line in lines:
        if line.startswith("│ --") and (printed := re.match(r"│ (--\S+(?: \S+)?)\s{2,}([^\s│].*)", line)):
            assert printed.start(2) <= 30, line  # 80 less the frame and 30 leaves 48 letters
    long = next((line for line in lines if line.startswith("│ --goal-pose")), None)
    if long:
        assert long.strip("│ ").startswith("--goal-pose FRAME:X,Y,Z")


@pytest.mark.parametrize("command", COMMANDS)
def test_panels_stand_in_their_order_and_examples_first(command):
    panels = re.findall(r"^╭─ (.+?) ─", help_of(command), flags=re.M)
    assert panels[0] == "Examples" and panels[-1] == "Output"
    kinds = [place(name) for name in panels if name not in ("Examples", "Arguments")]
    assert kinds == sorted(kinds)


def test_every_value_has_a_name_of_its_own():
    for name, command in get_command(app).commands.items():
        for option in command.params:
            assert option.param_type_name == "argument" or option.is_flag or option.metavar, (name, option.name)
    for command in COMMANDS:
        for line in help_of(command).splitlines():
            assert not re.match(r"│ \S.*<\w+>", line), line


@pytest.mark.parametrize("command", COMMANDS)
def test_usage_has_each_argument_once_in_help_and_in_errors(command):
    usage = " ".join(help_of(command, columns=200).split("\n\n")[0].split())
    assert re.fullmatch(rf"Usage: armdyn {command} \[OPTIONS\]( (\[[\w.|]+\]|[\w.|]+)(\.\.\.)?)*", usage), usage
    wrong = CliRunner().invoke(app, [command, "--no-such-option"], prog_name="armdyn", env={"COLUMNS": "200"})
    assert wrong.output.splitlines()[0] == usage


def test_a_motion_s_options_are_by_kind():
    panels = dict(re.findall(r"^╭─ (.+?) ─+╮\n(.*?)╰", help_of("mintime"), flags=re.M | re.S))
    where = {"--q-start": "Task", "--lock": "Robot", "--jerk-limit": "Limits", "--obstacle": "Scene",
             "--starts": "Solver", "--no-report": "Output", "--quiet": "Output", "--degrees": "Task"}  # fmt: skip
    for option, panel in where.items():
        assert option in panels[panel], option
    printed = " ".join(panels["Task"].replace("│", " ").split())
    assert "Numbers of --q-start, --q-goal, --via, --lock are degrees" in printed


def test_help_begins_with_examples_that_are_commands():
    words = help_of()
    examples = re.findall(r"^\s+armdyn (\w+)", words, flags=re.M)
    assert len(examples) >= 6 and set(examples) <= {*COMMANDS, "COMMAND"}
    assert words.index("armdyn mintime rr") < words.index("─ Motions") < words.index("─ Options")
    assert max(map(len, words.splitlines())) <= 80 and all(f"│ {name} " in words for name in COMMANDS)


def test_the_examples_of_commands_are_of_commands_and_options_that_there_are():
    for command in COMMANDS:
        words = help_of(command, columns=300)
        for line in re.findall(r"│ (armdyn .*?)\s+│", words):
            name, *rest = line.split()[1:]
            options = {word.partition("=")[0] for word in rest if word.startswith("--")}
            assert name in COMMANDS and all(option in help_of(name, columns=300) for option in options), line


def test_words_of_a_table_stay_whole_in_a_narrow_terminal(monkeypatch, capsys):
    monkeypatch.setenv("COLUMNS", "60")
    heads = ("motion", ">arrival", ">slower", ">work", ">speed", ">torque", "verdict")
    rows = [("PID (acceleration)", "4.5535 s", "+2061.4 %", "2.115 J", "0.249 %", "47.2 %", "Certified"), ("toppra",)]
    Terminal().print(table("motions", heads, rows))
    printed = capsys.readouterr().out.split()
    words = [word.removeprefix(">") for row in (heads, *rows) for cell in row for word in cell.split()]
    assert sorted(printed) == sorted(["motions", *words])


def test_a_column_of_numbers_is_as_wide_as_the_widest_line(monkeypatch, capsys):
    monkeypatch.setenv("COLUMNS", "80")
    Terminal().print(table("", ("joint", ">position\n[rad or m]"), [("joint1", "±3.142")]))
    assert max(map(len, capsys.readouterr().out.rstrip().splitlines())) == len("joint1  [rad or m]")


@pytest.mark.parametrize("command", ["mintime", "identify"])
def test_a_narrow_terminal_cuts_no_words(command):
    wide, narrow = (set(re.findall(r"[\w.]{4,24}", help_of(command, columns=width))) for width in (200, 40))
    assert wide - narrow == set()
