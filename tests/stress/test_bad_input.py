"""Nonsense on the command line and from Python is refused at once, in one line, and writes nothing.

The commands and options are read from the program: a new option needs a row with wrong values for
it.
"""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Iterator
from decimal import Decimal
from fractions import Fraction
from functools import partial
from pathlib import Path
from typing import Any

import click
import pytest
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st

import tippedisk_verify as tv
from tests.command_line import assert_refused
from tests.numbers.test_numbers import NO_NUMBERS
from tippedisk_verify.cli import cli

Wrong = tuple[Any, ...]
Call = Callable[[Any], object]

# -------------------------------------------------------------------------------- the command line
# What is wrong for an option. Where no word is right, words are drawn, too: no digits of any
# script, and no letters of "pi", "nan", of a disk's parameters or of paths.
WORDS = st.text(
    st.characters(exclude_categories=("Nd", "Cs"), exclude_characters="/\\.,-pialcremAB\0"),
    min_size=1,
)
_HUGE, _TEXT = "1" * 5000, "x" * 5000
#: Far too long, outside any range, not finite, of other scripts, with what a shell or a terminal
#: would act on.
NUMBER = (
    "nan",
    "",
    " ",
    "inf",
    "-inf",
    "1e400",
    "1e9999",
    "1e99999999",
    "1/0",
    "0x10",
    "1e",
    "e5",
    "--",
    *(
        "9" * 400,
        _HUGE,
        "30.4.1",
        "30 .4",
        "\ud800",
        "3\x00",
        "\x1b[31m1\x1b[0m",
        "1\n2",
        "½",
        "30.4f",
        "1e+",
    ),
    *("+-1", "1**2", "__import__", WORDS),
)
SPEED = (*NUMBER, "1_000", "-1", "0", "-0", "pi", "1e-9999", "-1e-3", "1e6", "1e300", "1000000007")
DISTANCE = (*NUMBER, "-1", "0", "-1e-3", "pi")
COUNT = (*NUMBER, "-1", "0", "1e3", "3.5", "99999999999999999999", "1000000007")
NAME = (_TEXT, "", "../../etc/passwd", "\x1b]0;x\x07", "\ud800", "a\nb", "\0", WORDS)
FOLDER = ("/dev/null/x", "", "/proc/nothing", "a\0b", _TEXT, "file", "file/below", "loop/x")
TARGET = (
    "nowhere/x.csv",
    "",
    ".",
    "/dev/null",
    "a\0.csv",
    _TEXT + ".csv",
    "folder",
    "folder/",
    "file/x.csv",
    "pipe",
)
SOURCE = (
    *(
        "nowhere.toml",
        "",
        ".",
        "/dev/null",
        "/dev/zero",
        "a\0.toml",
        _TEXT + ".toml",
        "folder",
        "pipe",
        "loop",
    ),
    "./file",
    "../../../../../../etc/passwd",
    "/proc/self/mem",
    "~/.toml",
    "\ud800.toml",
    "huge.toml",
    "link.toml",
)
AXIS = (
    "mu=",
    "mu=,",
    "g=1:2",
    "x=1",
    "g=nan",
    "mu=1:2:1e3",
    "mu=0:1:999999999",
    "mu=0:1:1000001",
    "mu=1:2:٣",
    *(
        "mu=1e-9999:1:1000000",
        "omega=30",
        "mu=pi:1:3",
        "mu=1:2:3:4",
        "epsilon=1/0",
        "mu=" + "1," * 3000,
        *NAME,
    ),
)


def _but(wrong: Wrong, *right: str) -> Wrong:
    return tuple(text for text in wrong if text not in right)


#: For options and arguments, or for those of one command.
WRONG: list[tuple[Wrong, str]] = [
    (SPEED, "--omega, --omegas, --above-het, --below-het, --omega-h, --near"),
    ((*NUMBER, "31", "pi", "-1e6", "-1e9999"), "--below-crit"),
    (DISTANCE, "--cycles"),
    ((*NUMBER, "pi/2", "1e999"), "--beta, --gamma"),
    ((*NUMBER, "-1", "0", "3.1416"), "--to"),
    (("nan", "", "x", "inf", "1/0"), "--guess, --velocity"),
    (("x", "", "1,2", "1,2,0,0", "nan,1,0", "4,1,0", "1,1/0,0", "1,1,1e400"), "--margin"),
    (("x", "", "1,2", "1,2,0,0", "nan,1,0", "1,1/0,0", "1,1,1e400"), "--state"),
    (("x", "", "nan", "1,", "1,2,3", "1,1e400"), "--time"),
    (("x", "", "0", "1", "-5", "1000001", "nowhere.txt", "out"), "--times"),
    (("x", "flat", "section,", "section,section"), "--events"),
    ((*NUMBER, "-1", "0", "1e9"), "--seconds, --limit"),
    (_but(NUMBER, "9" * 400), "--sample, reference check --seed"),
    (
        COUNT,
        "--digits, --jobs, --harmonics, --count, --fold, --levels, --states, --require, "
        "--max-steps",
    ),
    (_but(COUNT, "0", "1000000007"), "--order, --seed"),
    (NAME, "--friction, --only, --format, --method, --set, --from, --error"),
    (NAME, "names, ids, prefixes, language, analysis"),
    (_but(NAME, ""), "more, prefix"),
    ((*NAME, "dask://\0", "dask://"), "--executor"),
    (AXIS, "--over"),
    (FOLDER, "--out, --data"),
    (TARGET, "--certificate, --html, --csv, --badge"),
    (
        (*TARGET, "x.txt"),
        "sweep --out, integrate --out, reference export --out, branch --out, heteroclinic --out",
    ),
    ((*TARGET, "answered.csv"), "conformance questions file"),
    (SOURCE, "--expected-failures, --answers, --program, file, old, new, command"),
    (
        ("x", "", "1:2", "1:2:0", "0:1:3", "1:x:2", "nan:1:2", "1:2:1001", "1:2:3:4"),
        "heteroclinic --near",
    ),
    ((*SOURCE, *NAME, "nan.toml", "hexadecimal.toml", "long.toml", "nested.toml"), "--parameters"),
]
#: What makes a command right, in one way or another. Spoiled is what it names, and in the first all
#: other options.
_AT_A_SPEED = "--omega 30.4 | --below-crit 0.5"
RIGHT = {
    "verify": "--only omega_crit",
    "scene": "d",
    "orbit": "--omega 30.4 | --above-het 0.1 | --below-crit 0.5 | --rotating --below-het 0.01",
    "integrate": "--omega 30.4 --state 1,1,0 --time 1 | --omega 30.4 --state 1,1,0 --time 1,2 "
    "--times 3 --events turn",
    "slow-manifold": "--order 1 --omega 30.4 --beta 1.2 --gamma 0.3",
    "basin": "--omega 30.4 --count 4 --seconds 5 | --omega 31.4 --margin 1.5,1,0 | --below-crit "
    "0.5 --count 4",
    "sweep": "hopf --over mu=0.3 --out o.csv",
    "certify orbit": "--omega 30.4 | --below-crit 0.5 | --at-fold --fold 1",
    "heteroclinic": " | --near 1e-2:1e-3:2",
    "certify heteroclinic": " | --cycles 1e-3 --certificate c.json",
    "certify branch": "--certificate c.json | --to 3 --out out",
    "reference export": "table1/linear/hopf --out o.csv",
    "conformance questions": "q.csv --levels 3 | q.csv --states 2 --seed 7",
    "conformance grade": "answered.csv",
    "conformance run": "cat --levels 3 | cat --states 2 --seed 7",
    "conformance compare": "answered.csv answered.csv",
}


def _spoiled(words: list[str], parameter: click.Parameter, place: int, text: str) -> list[str]:
    """Return the command with a text for a parameter; ``place`` is an argument's index."""
    if isinstance(parameter, click.Argument):
        return [*words[:place], text, *words[place + 1 :]]
    name = parameter.opts[0]
    at = words.index(name) if name in words else len(words)
    return [*words[:at], *words[at + 2 :], name, *[text] * parameter.nargs]


def _mistakes(
    command: click.Command, name: str = ""
) -> Iterator[tuple[str, Wrong, Callable[[str], list[str]]]]:
    """Yield, for all parameters of all commands, the name, the wrong value, and the command."""
    if isinstance(command, click.Group):
        for inner in (inner for inner in command.commands.values() if not inner.hidden):
            yield from _mistakes(inner, f"{name} {inner.name}".strip())
        return
    usual = (
        _AT_A_SPEED if any(parameter.name == "below_crit" for parameter in command.params) else ""
    )
    wrong = {told: wrong for wrong, names in WRONG for told in names.split(", ")}
    rights = [f"{name} {rest.strip()} " for rest in RIGHT.get(name, usual).split("|")]
    place = len(name.split())
    for parameter in command.params:
        if isinstance(parameter, click.Argument) or not parameter.is_flag:
            told = parameter.opts[0]
            right = next((line for line in rights if f" {told} " in line), rights[0]).split()
            at = len(right) if told == "more" else place
            yield (
                name,
                wrong.get(f"{name} {told}") or wrong[told],
                partial(_spoiled, right, parameter, at),
            )
            place += isinstance(parameter, click.Argument)


MISTAKES = list(_mistakes(cli))


@st.composite
def mistakes(draw: st.DrawFn) -> list[str]:
    """Draw a command that is right except for one option or argument."""
    _, wrong, spoiled = draw(st.sampled_from(MISTAKES))
    texts = st.sampled_from([text for text in wrong if text is not WORDS])
    return spoiled(draw(texts | WORDS if WORDS in wrong else texts))


@pytest.fixture
def room(tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Make a folder with obstacles: files, folders, pipes, link circles, a huge file, bad disks."""
    folder = tmp_path_factory.mktemp("room")
    monkeypatch.chdir(folder)
    (folder / "folder").mkdir()
    (folder / "file").write_text("mine")
    (folder / "answered.csv").write_text("id,answer\nprinted/linear/hopf/point/omega_crit,30.9\n")
    (folder / "loop").symlink_to(folder / "loop")
    (folder / "link.toml").symlink_to("/etc/passwd")
    os.mkfifo(folder / "pipe")
    with open(folder / "huge.toml", "wb") as stream:
        stream.truncate(1 << 30)
    disk = "".join(f'{name} = "{value}"\n' for name, value in tv.PRINTED.decimals().items())
    for name, radius in (
        ("nan", '"nan"'),
        ("hexadecimal", "0x" + "f" * 9000),
        ("long", f'"0.{"4" * 9000}"'),
    ):
        (folder / f"{name}.toml").write_text(disk.replace('"0.045"', radius))
    (folder / "nested.toml").write_text("[" * 100_000)
    return folder


def _contents(folder: Path) -> dict[str, tuple[int, int, int]]:
    """Return the files with their times, without the folder of --out, which may hold a lock."""
    found = {str(path.relative_to(folder)): path.lstat() for path in folder.rglob("*")}
    kept = {name: (is_.st_mode, is_.st_size, is_.st_mtime_ns) for name, is_ in found.items()}
    return {name: what for name, what in kept.items() if not name.startswith("out")}


@pytest.mark.parametrize("command", dict.fromkeys(name for name, *_ in MISTAKES))
def test_every_option_of_every_command_is_checked(command: str, room: Path) -> None:
    before = _contents(room)
    for name, wrong, spoiled in MISTAKES:
        if name == command:
            assert_refused(spoiled(wrong[0]))
    assert _contents(room) == before


@pytest.mark.parametrize("draws", [60, pytest.param(1_000, marks=pytest.mark.slow)])
def test_one_mistake_is_refused_and_nothing_is_written(room: Path, draws: int) -> None:
    """A draw that is not refused may run for long, so it is reported as it is, not made shorter."""
    before = _contents(room)

    @settings(
        max_examples=draws,
        phases=[Phase.generate],
        suppress_health_check=list(HealthCheck),
        deadline=None,
    )
    @given(mistakes())
    def hold(arguments: list[str]) -> None:
        assert_refused(arguments)
        assert draws > 1000 or _contents(room) == before

    hold()
    assert _contents(room) == before


# ------------------------------------------------------------------------------------- from Python
_DISK, _LANES, _ID = tv.Disk("table1"), tv.BatchTaylor(1), "table1/linear/hopf/point/period"
_ENGINE, _OTHER = tv.Taylor(), tv.ScipyEngine()
#: Values of every Python type that no parameter of a public function may take.
OBJECTS: Wrong = (
    *(
        None,
        b"30.4",
        [],
        [30.4],
        {},
        set(),
        object(),
        1j,
        len,
        int,
        ...,
        NotImplemented,
        range(3),
        iter(()),
    ),
    *(Exception("x"), memoryview(b"x"), frozenset({1}), True, False),
)
TEXTS = ("", "abc", "\0")
NUMBERS = (
    *(
        "nan",
        "1e99999",
        "\ud800",
        _HUGE,
        math.nan,
        math.inf,
        -math.inf,
        Decimal("nan"),
        Decimal("sNaN"),
    ),
    *(Decimal("1e999999"), *TEXTS, *OBJECTS),
)
SPEEDS = (
    *NUMBERS,
    0,
    -1,
    10**6,
    10**400,
    -(10**400),
    1e300,
    Fraction(1, 10**5000),
    "pi",
    "pi/2",
    "1e-9999",
)
COUNTS = (*NUMBERS, 0, -1, 10**9, 10**400, -(10**400), 1e300, Fraction(1, 3), "12", 3.5)


def _asked(law: Any = "linear", **changes: Any) -> object:
    """Check that both engines refuse the request, if it can be made."""
    told = {"omega": "30.4", "state": ("pi/2", 2, 0), "duration": 1} | changes
    request = tv.Request(tv.PRINTED.with_friction(law), **told)
    with pytest.raises(tv.InputError):
        _OTHER(request)
    return _ENGINE(request)


def _flown(place: int, wrong: Any) -> object:
    told: list[Any] = [[0.045, 0.0025, 5e-4, 5e-4, 9.81, 29.0], [30.4], [[1.5, 1.6, 0]], [1.0]]
    return _LANES(*told[:place], wrong, *told[place + 1 :])


def _integrated(omega: Any = "30.4", gamma: Any = 2, duration: Any = 1, **more: Any) -> tv.Solution:
    return _DISK.integrate(omega, ("pi/2", gamma, 0), duration, **more)


#: Values that each of these calls must refuse.
CALLS: list[tuple[Wrong, list[Call]]] = [
    (
        tuple(value for value, _ in NO_NUMBERS.values()),
        [
            lambda x: tv.DOUBLE.number(x),
            lambda x: tv.precision_of_bits(100).number(x),
            lambda x: tv.Measured.of(1, x),
            lambda x: tv.Disk("table1", mu=x),
            lambda x: _DISK.equilibrium("inverted", x),
            lambda x: _DISK.rhs(x),
            lambda x: _DISK.branch(["30.4", x]),
            lambda x: _DISK.speed(above_het=x if x is not None else "nan"),
            lambda x: _DISK.integrate("30.4", (1.5, 1.6, x), "0.01"),
            lambda x: _integrated(duration=(0, x)),
            lambda x: _integrated(t_eval=[0.5, x]),
            lambda x: tv.Request(_DISK, "30.4", (1.5, 1.6, 0), 1, times=[0.5, x]),
            lambda x: _DISK.slow_manifold(1, "30.4", at=(x, "0.3")),
            lambda x: _DISK.basins("30.4", count=4, v=x),
            lambda x: _DISK.basins("30.4", count=4, duration=x),
            lambda x: _flown(1, [x]),
            lambda x: _flown(2, [[1.5, x, 0.0]]),
            lambda x: _DISK.hopf(digits=x),
        ],
    ),
    (
        NUMBERS,
        [
            lambda x: tv.exact(x),
            lambda x: tv.exact("pi") - x,
            lambda x: tv.precision_of_bits(100).number(x),
            lambda x: tv.PRINTED.with_friction(x),
            lambda x: _DISK.equilibrium(x, "30.4"),
            lambda x: tv.Disk(**dict.fromkeys(("r", "e", "m", "A", "B", "g", "mu", "epsilon"), x)),
            lambda x: _integrated(omega=x),
            lambda x: _integrated(gamma=x),
            lambda x: _integrated(duration=x),
            lambda x: _asked(omega=x),
            lambda x: _asked(duration=x),
            lambda x: _asked(state=(x, 2, 0)),
            lambda x: tv.compare(_ID, 1.0, reading=x),
        ],
    ),
    ((*NUMBERS, 0, -1, "1e40", "1e-40", "pi", 10**5000), [lambda x: tv.PRINTED.changed(mu=x)]),
    (("0.045", "1", "nan", -1), [lambda x: tv.CALIBRATED.changed(e=x)]),
    (("1", "1e-9", "inf"), [lambda x: tv.GEOMETRY.changed(B=x)]),
    (
        (*NUMBERS, "1e5000", 10**5000),
        [lambda x: tv.DOUBLE.number(x), lambda x: tv.QUADRUPLE.number(x)],
    ),
    ((-1, math.nan, -1e-300, math.inf), [lambda x: tv.Measured.of(0, x)]),
    ((*TEXTS, "a\0.toml", "/", ".", _TEXT, "\ud800.toml"), [lambda x: tv.Parameters.named(x)]),
    (
        COUNTS,
        [
            lambda n: _DISK.hopf(digits=n),
            lambda n: _DISK.equilibrium("inverted", "30.4", digits=n),
            lambda n: tv.one_harmonic(tv.PRINTED, "30.4", digits=n),
            lambda n: _DISK.slow_manifold(1, digits=n),
            lambda n: _DISK.harmonic_balance("30.4", digits=n),
            lambda n: _integrated(digits=n),
            lambda n: _DISK.limit_cycle("30.4", digits=n),
            lambda n: _DISK.limit_cycle(above_het="0.1", digits=n),
        ],
    ),
    ((*COUNTS, 23, 4_000_001), [lambda n: tv.precision_of_bits(n)]),
    ((*COUNTS, 1001), [lambda n: _DISK.heteroclinic(digits=n)]),
    ((*OBJECTS, -1, 41, 10**400, 0.5, math.nan), [lambda n: _DISK.slow_manifold(n)]),
    ((0, -1, 1025, 10**400), [lambda n: _DISK.harmonic_balance("30.4", harmonics=n)]),
    (
        SPEEDS,
        [
            lambda x: _DISK.equilibrium("inverted", x),
            lambda x: tv.one_harmonic(tv.PRINTED, x),
            lambda x: _DISK.harmonic_balance(x),
            lambda x: _DISK.limit_cycle(x),
            lambda x: _DISK.rhs(x),
            lambda x: _DISK.branch(["30.4", x]),
            lambda x: _DISK.basins(x, count=4, duration=5.0),
        ],
    ),
    ((*NUMBERS, 40), [lambda x: _DISK.limit_cycle(below_crit=x)]),
    # None stands for another way to give the speed.
    (
        tuple(x for x in (*NUMBERS, 0, -1, 10, "1e-900", "pi") if x is not None),
        [
            lambda x: _DISK.limit_cycle(above_het=x),
        ],
    ),
    (
        ((), (1.0,), (1.0, -1.0, 2.0), *((x, x) for x in (math.nan, math.inf, 0, 10**400))),
        [
            lambda x: tv.shoot_limit_cycle(tv.PRINTED, "30.4", _ENGINE, guess=x),
        ],
    ),
    ((*TEXTS, *OBJECTS), [lambda x: _DISK.heteroclinic(method=x)]),
    ((*TEXTS, *OBJECTS[1:]), [lambda x: tv.Disk(x)]),
    ((*TEXTS[1:], _ID + "\0", *OBJECTS), [lambda x: tv.references(x)]),
    (
        (*TEXTS, None, 1),
        [lambda x: tv.references(_ID, reading=x), lambda x: tv.grade({_ID: 1.0}, reading=x)],
    ),
    (
        TEXTS,
        [
            lambda x: tv.Disk("table1", friction=x),
            lambda x: _asked(x),
            lambda x: _asked(domain=x),
            lambda x: tv.Audit(tv.PRINTED, _ENGINE).computed_scene("d", x),
            lambda x: tv.Audit(tv.PRINTED, _ENGINE).computed_scene(x, "printed"),
        ],
    ),
    (([2.0], [0.5, 0.25], ["a"], "ab"), [lambda x: _integrated(t_eval=x)]),
    ((0, -1, "1e-30", 4), [lambda x: _DISK.integrate("30.4", (x, 2, 0), 1)]),
    (
        ([], [2.0], [0.5, 0.5], [-1.0], ["x"], [math.nan], [10**400], [[0.5]]),
        [lambda x: _asked(times=x)],
    ),
    (((), (1, 2), (1, 2, 3, 4), "ab"), [lambda x: _asked(state=x)]),
    ((0.0, 1.0, -1.0, math.nan, math.inf), [lambda x: _asked(tolerance=x)]),
    ((0, -1, 10**400), [lambda n: _asked(max_steps=n)]),
    ((("abc",), ("beta", "beta")), [lambda x: _asked(variations=x)]),
    (("same", "flat"), [lambda x: _asked(events=(tv.Event(x, len), tv.Event(x, len)))]),
    ((1.5, -1e-3, [0.5, 2], "a", math.nan), [lambda x: _integrated()(x)]),
    ((0, -1, 10**9, 10**400, 3.5), [lambda n: _DISK.basins("30.4", count=n)]),
    ((0.0, -1.0, math.nan, math.inf, 1e300), [lambda x: _DISK.basins("30.4", count=4, duration=x)]),
    ((math.nan, math.inf, 1e4), [lambda x: _DISK.basins("30.4", count=4, duration=5.0, v=x)]),
    ((-1, 1.5), [lambda n: _DISK.basins("30.4", count=4, duration=5.0, seed=n)]),
    ((0.5, -1, 10**9, 65), [lambda n: tv.BatchTaylor(n)]),
    (
        (None, "", "abc", [], [[]], ["x"], [1.0, 2.0], [[1.0]], 1j, [10**400], {}),
        [
            lambda x: _flown(0, x),
            lambda x: _flown(1, x),
            lambda x: _flown(2, x),
            lambda x: _flown(3, x),
        ],
    ),
    (
        (*NUMBERS, "../../etc/passwd", "printed"),
        [lambda x: tv.reference(x), lambda x: tv.compare(x, 1.0)],
    ),
    (OBJECTS, [lambda x: tv.compare(_ID, x)]),
    (
        ({}, {"abc": 1.0}, {1: 1.0}, {"fresh-1-1/both/rhs/01/Q": 1.0}, *OBJECTS),
        [lambda x: tv.grade(x)],
    ),
    ((*TEXTS, "g", "A", "aa", _TEXT, *OBJECTS), [lambda x: tv.scene_named(x)]),
    ((*TEXTS, "Cycle", _TEXT, *OBJECTS), [lambda x: tv.problem_named(x)]),
    ((*TEXTS, "RK23", _TEXT, *OBJECTS), [lambda x: tv.ScipyEngine(x)]),
]


@pytest.mark.parametrize(
    ("call", "wrong"),
    [(call, wrong) for wrong, several in CALLS for call in several],
    ids=lambda value: " ".join(value.__code__.co_names) if hasattr(value, "__code__") else "",
)
def test_nonsense_from_python(call: Call, wrong: Wrong) -> None:
    for value in wrong:
        with pytest.raises(tv.InputError) as refused:
            pytest.fail(f"a call took {type(value)} and gave {call(value)!r:.60}")
        assert 0 < len(str(refused.value)) < 1000
