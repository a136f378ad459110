"""The command line's promises: running examples, whole sentences, 80 columns, whole files, and one
line for each mistake.
"""

from __future__ import annotations

import re
import shlex
from collections.abc import Iterator
from dataclasses import is_dataclass
from pathlib import Path

import click
import pytest

from tests.command_line import answer, assert_refused, printed, rows_of
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


# ------------------------------------------------------------------------------ files, and refusals
def test_scene_writes_whole_files(tmp_path: Path) -> None:
    out = tmp_path / "new" / "folder"
    assert "flat at" in printed(f"scene a --out {out}")
    names = sorted(path.name for path in out.iterdir())
    assert names == [
        "scene_a_orbit_1.csv",
        "scene_a_orbit_2.csv",
        "scene_a_slow_manifold.csv",
        "scenes_2d.png",
        "scenes_2d.svg",
        "scenes_3d.png",
        "scenes_3d.svg",
    ]
    header, first, *_ = (out / "scene_a_orbit_1.csv").read_text(encoding="utf-8").splitlines()
    assert header == "t [s],beta [rad],gamma [rad],v [rad/s]"
    assert first == "0.0,1.5707963268,-1.5707963268,2.0"


def test_integrate_prints_and_writes_a_motion(tmp_path: Path) -> None:
    asked = (
        "integrate --omega 30.4 --state pi/2,pi/2+0.4,0 --time 1,2 --events section,turn --times"
    )
    for name in ("motion.csv", "motion.png"):
        found = answer(f"{asked} 5 --out {tmp_path / name}")
    assert found["t"] == ["1", "1.25", "1.5", "1.75", "2"]
    assert [record["name"] for record in found["events"]] == ["turn", "section", "turn", "section"]
    assert {"t", "beta", "gamma", "v"} <= set(found["events"][0])
    header, first, *_ = (tmp_path / "motion.csv").read_text().splitlines()
    assert (
        header
        == "t,beta,gamma,v,beta_uncertainty,gamma_uncertainty,v_uncertainty,event,t_uncertainty"
    )
    assert (first[:17], first[-2:]) == ("1,1.5707963267948", ",,")
    rows = rows_of(tmp_path / "motion.csv")
    assert [row["event"] for row in rows] == [""] * 5 + ["turn", "section", "turn", "section"]
    assert all(row["t_uncertainty"] and 1 < float(row["t"]) < 2 for row in rows[5:])
    assert (tmp_path / "motion.png").read_bytes()[:4] == b"\x89PNG"
    (tmp_path / "times").write_text("t\n1\n1.5,0\n")
    lines = printed(f"{asked} {tmp_path / 'times'}").splitlines()
    assert [line.split(",")[0] for line in lines[-2:]] == ["  t 1", "  t 1.5"]
    for wrong in ("1", "nowhere", "2 --events flat", "2 --out x.txt", "2 --state 3.2,2,0"):
        assert_refused(f"{asked} {wrong}".split())


#: Commands that are refused, and words of the line that says why.
REFUSED = [
    ("hopf --digits 0", "a whole number from 1 to 4000, not 0"),
    ("hopf --friction smooth", "smooth"),
    ("certify check nofile.json", "nofile.json"),
    ("conformance grade names.csv", "it has 'name', 'value'"),
    ("bench --only nothing", "problem 'nothing' is not known"),
    ("bench --program no-such-program", "cannot be started"),
    ("stress --only 'no such thing'", "case 'no such thing' is not known"),
    ("reference show omega_crit", "did you mean table1/linear/hopf/point/omega_crit"),
    ("reference prove", "No such command 'prove'"),
    ("reference export nothing --out a.csv", "starts with"),
    # speeds
    ("orbit --omega 30.4 --below-crit 0.5", "--above-het and --at-fold, not with several"),
    ("orbit --above-het 0.9", "0.9"),
    ("orbit --rotating", "one of --omega, --below-crit, --below-het and --at-fold"),
    ("orbit --rotating --unstable --at-fold", "--unstable goes with"),
    ("orbit --rotating --above-het 1e-3", "do not rotate"),
    ("orbit --below-het 1e-3", "belongs to --rotating"),
    ("orbit --rotating --below-het 0.05", "rad/s below Omega_h"),
    ("branch --omegas 30.4 --paper-sets", "--paper-sets"),
    ("harmonic-balance", "give the speed with one of --omega and --below-crit"),
    ("basin --omega 30.5 --margin 1,2", "three numbers"),
    ("basin --omega 30.5 --margin 4,2,0", "between 0 and pi"),
    ("basin --omega 29 --margin 1,2,0", "fold near"),
    # the study next to Omega_h
    ("heteroclinic --near 1:2", "FIRST:LAST:COUNT"),
    ("heteroclinic --near 0:1:3", "FIRST:LAST:COUNT"),
    ("heteroclinic --near 1e-2:1e-3:0", "FIRST:LAST:COUNT"),
    ("heteroclinic --near 1e-2:x:2", "FIRST:LAST:COUNT"),
    ("heteroclinic --answers x.csv", "go with --near"),
    ("heteroclinic --out x.png", "go with --near"),
    # sweeps
    *((f"sweep hopf --out a.csv --over g={x}", "a range ") for x in ("1:2", "1:2:x", "1:2:1")),
    ("sweep hopf --out a.csv --over g=1:pi:3", "a range "),
    ("sweep hopf --out a.csv --over g=b", "'b'"),
    ("sweep orbit --out a.csv --over mu=0.3", "either omega"),
    ("sweep hopf --out a.csv --over omega=30", "cannot be swept over"),
    ("sweep orbit --out a.csv --over omega=30 --over below-crit=0.5", "either"),
    ("sweep hopf --out a.csv --over mu=1 --over mu=2", "given twice"),
    # proofs
    ("certify equilibria --omega 30 --every-speed", "--every-speed takes the place"),
    ("certify hopf --friction smooth", "smooth"),
    ("certify heteroclinic --digits 301", "300 digits"),
    ("certify heteroclinic --near -1", "between 1e-6 and 1e6"),
    ("certify heteroclinic --cycles 1", "between 0 and 1"),
    ("certify heteroclinic --cycles 0.001 --friction smooth", "linear friction law"),
    ("certify orbit --fold 1 --omega 30", "belongs to --at-fold"),
    ("certify orbit --at-fold --below-crit 1", "leave out"),
    ("certify orbit --at-fold --friction smooth", "linear"),
    ("certify orbit --rotating", "give the speed"),
    ("certify orbit --omega 30.4 --friction sticky", "sticky"),
    ("certify orbit --omega x", "x"),
    ("certify orbit --below-crit 0.5 --digits 0", "digits"),
    # bounds: one beyond what is had, or too much in all
    ("hopf --digits 4001", "from 1 to 4000"),
    ("heteroclinic --digits 1001", "to 1000 digits"),
    ("scene d --digits 13", "at most 12 digits"),
    ("slow-manifold --order 41", "between 0 and 40"),
    ("orbit --above-het 1e-30 --digits 1000", "to 1000 digits"),
    ("orbit --above-het 1e-801", "down to 1e-800"),
    ("harmonic-balance --omega 30.4 --harmonics 1025", "between 1 and 1024"),
    ("basin --omega 30 --seconds 4", "more than 4 s"),
    ("scene a --omega-h 0.05", "not positive"),
    ("basin --omega 30.4 --count 10000001", "10000000 states"),
    ("sweep hopf --over mu=0.3 --out o.csv --jobs 1000000", "--jobs must lie between"),
    ("sweep hopf --over mu=0:1:1001 --over g=9:10:1000 --out o.csv", "1000000 points"),
    ("branch --omegas 30.4,1e300", "below 1e6 rad/s"),
    # no cycle is there
    ("branch --omegas 31,31.5", "no limit cycle"),
    ("branch --omegas 29", "no limit cycle"),
    ("harmonic-balance --omega 4", "no limit cycle"),
    ("orbit --omega 29", "no limit cycle"),
    # words that do not go together, or are missing, or are nobody's
    ("equilibria --omega 30.4 --below-crit 0.5", "one of --omega and --below-crit"),
    ("verify --only ,", "no claim"),
    ("verify omega_crit", "--only"),
    ("scene", "NAME"),
    ("scene d --wrong", "--wrong"),
    ("launch", "'launch'"),
]


@pytest.mark.parametrize(("asked", "word"), REFUSED)
def test_a_refusal_names_what_is_wrong_and_writes_nothing(
    asked: str, word: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("names.csv").write_text("name,value\n1,2\n")
    line = assert_refused(shlex.split(asked))
    assert word in line
    assert len(line) < 400
    assert [path.name for path in tmp_path.iterdir()] == ["names.csv"]
