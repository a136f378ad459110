"""The command line's promises: running examples, whole sentences, 80 columns, README commands."""

from __future__ import annotations

import re
import shlex
from collections.abc import Iterator
from dataclasses import is_dataclass
from pathlib import Path

import click
import pytest

from tests.command_line import printed
from tippedisk_verify import display
from tippedisk_verify.bench.problems import PROBLEMS
from tippedisk_verify.cli import cli
from tippedisk_verify.commands import tables
from tippedisk_verify.reference_values.store import load_store
from tippedisk_verify.theory.hopf import HopfPoint

CONTEXT = click.Context(cli, info_name="tippedisk-verify", terminal_width=80)


def _commands(group: click.Group, path: str = "") -> Iterator[tuple[str, click.Command]]:
    for name in group.list_commands(CONTEXT):
        command = group.get_command(CONTEXT, name)
        yield f"{path}{name}", command
        if isinstance(command, click.Group):
            yield from _commands(command, f"{path}{name} ")


COMMANDS = dict(_commands(cli))


def _help(path: str) -> str:
    command, context = cli, CONTEXT
    for name in path.split():
        command = command.commands[name]
        context = click.Context(command, parent=context, info_name=name)
    return command.get_help(context)


def parsed(words: list[str]) -> None:
    """Parse a command without computing anything.

    Raises:
        click.ClickException, InputError: It is not a command.
    """
    command, path, name = cli, CONTEXT, ""
    while isinstance(command, click.Group) and words and not words[0].startswith("-"):
        name, *words = words
        below = command.get_command(path, name)
        assert below is not None, f"there is no command {name}"
        command, path = below, click.Context(below, parent=path, info_name=name)
    if not isinstance(command, click.Group):
        command.make_context(name, words, parent=path.parent)


EXAMPLES = {
    path: re.findall(r"^ +tippedisk-verify (.+)$", _help(path), re.MULTILINE)
    for path, command in COMMANDS.items()
    if not command.hidden
}
#: The beginnings of examples that take more than some seconds; these are only parsed.
LONG = (
    "verify --out",
    "branch --paper-sets",
    "bench",
    "stress --quick",
    "scene b d",
    "certify branch",
    "certify heteroclinic",
    "certify orbit",
    "certify check",
    "conformance run",
    "reference check",
    "slow-manifold --order 2",
    "sweep",
    "basin",
    "heteroclinic --digits",
    "orbit --rotating",
    "harmonic-balance --omega",
    "branch",
)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the folder of the examples, with a user's files: answers, old and new."""
    here = tmp_path_factory.mktemp("examples")
    for name in ("answers.csv", "old.csv", "new.csv"):
        (here / name).write_text(
            "id,answer\nprinted/linear/hopf/point/omega_crit,30.886592688643568\n"
        )
    return here


@pytest.mark.parametrize(
    "example", [example for examples in EXAMPLES.values() for example in examples]
)
def test_an_example_of_the_help_runs(
    example: str, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(folder)
    if example.startswith(LONG):
        parsed(shlex.split(example))
    else:
        printed(f"{example} --quiet")


def test_each_command_has_two_examples_at_the_end_of_its_help() -> None:
    for path, examples in EXAMPLES.items():
        assert len(examples) == 2, path
        assert all(example.startswith(path) for example in examples), path
        assert _help(path).rstrip().endswith(examples[1]), path


def test_help_is_whole_sentences_in_80_columns() -> None:
    overview = _help("")
    listed = re.findall(r"^  ([a-z][\w-]+)  ", overview, re.MULTILINE)
    assert sorted(listed) == sorted(cli.commands)
    assert "..." not in overview.split("Options:")[1]
    for path in ("", *COMMANDS):
        assert max(map(len, _help(path).splitlines())) <= 80, path
        for command in getattr(COMMANDS.get(path, cli), "commands", {}).values():
            assert command.hidden or command.get_short_help_str().endswith("."), command.name


def test_the_help_of_bench_names_its_problems() -> None:
    (listed,) = re.findall(r"--only PROBLEM (.*?)\.", " ".join(_help("bench").split()))
    assert re.findall(r"[\w-]+", listed.partition(":")[2].replace(" or ", " ")) == [
        one.name for one in PROBLEMS
    ]


def test_the_duration_of_verify_is_the_same_everywhere() -> None:
    root = Path(__file__).parents[1]
    texts = [
        *((root / name).read_text(encoding="utf-8") for name in ("README.md", "docs/commands.md")),
        _help("verify"),
    ]
    durations = r"(?:half )?a minute(?: and a half| to a minute)?(?= on two cores)"
    assert [re.findall(durations, " ".join(text.split())) for text in texts] == [["a minute"]] * 3


def test_verify_prints_the_verdict_of_an_equation_and_of_a_number() -> None:
    assert printed("verify --only eq.28,14").startswith(
        "eq. (28) has no verdict of its own; eq. (39), which is derived from it, does not follow "
        "(term), by the claim "
        "kappa_2\neq. (14): holds, by the claim linearization\n"
    )
    line = "omega_crit  fails for table1  30.8866 rad/s (paper: 30.92)\n"
    assert line in printed("verify --only omega_crit")


@pytest.mark.parametrize(
    "command",
    [
        "stress --list",
        "integrate --omega 30.4 --state pi/2,2,0 --time 1 --times 3",
        "certify equilibria --omega 30.4",
        "hopf --digits 50",
    ],
)
def test_on_a_terminal_lines_end_between_words(
    command: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    words = printed(command).split()
    monkeypatch.setattr(tables, "_width", lambda: 80)
    narrow = printed(command)
    assert narrow.split() == words or sorted(narrow.split()) == sorted(words)
    assert max(len(line) for line in narrow.splitlines() if len(line.split()) > 1) <= 80


def test_units_are_those_of_the_reference_data() -> None:
    compared = set()
    for quantity in load_store().values():
        name = quantity.id.rsplit("/", 1)[-1]
        # What the commands print has the meaning of these kinds; "beta@0.5" and the like have no
        # name here.
        if (
            quantity.kind in ("hopf", "limit-cycle", "heteroclinic")
            and display.column_heading(name) != name
        ):
            assert display.column_heading(name) == f"{name} [{quantity.unit}]"
            compared.add(name)
    assert {
        "omega_crit",
        "period",
        "gamma_bar_0",
        "v_0",
        "beta_max",
        "omega_h",
        "dperiod_domega",
    } <= compared
    assert display.column_heading("multiplier_slow") == "multiplier_slow"


def test_a_quantity_has_one_unit() -> None:
    """Check that a quantity has one unit and a meaning in all classes."""
    units: dict[str, set[str]] = {name: {what.unit} for name, what in display.COORDINATES.items()}
    for kind in _results(display.Printable):
        for name, what in display.quantities(kind).items() if is_dataclass(kind) else ():
            units.setdefault(name, set()).add(what.unit)
            assert what.meaning
    assert {name: meanings for name, meanings in units.items() if len(meanings) > 1} == {}
    assert display.quantities(HopfPoint)["period"].unit == "s"
    assert len(units) > 40


def _results(kind: type) -> Iterator[type]:
    for below in kind.__subclasses__():
        yield below
        yield from _results(below)
