"""Nonsense of every kind, and what counts as a refusal: status 2, one clear line, nothing on standard output."""

from __future__ import annotations

import contextlib
import io
import re
import time
from dataclasses import dataclass, field
from decimal import Decimal
from fractions import Fraction
from pathlib import Path
from typing import Any

from hypothesis import strategies as st

from tippedisk_verify.cli import main

#: Text that is no number and no path to anything: no digit of any script, no slash, no letters of "pi" or "nan".
WORDS = st.text(st.characters(exclude_categories=("Nd", "Cs"), exclude_characters="/\\.pialcrem\0"), max_size=40)
#: Far too long, outside any range, not finite, of other scripts, with what a shell or a terminal would act on.
ODD_NUMBERS = (
    *("", " ", "nan", "inf", "-inf", "1e400", "1e9999", "1e99999999", "1e-9999", "1/0", "pi", "-1", "0", "-0", "0x10"),
    *("1_000", "30,4", "1e", "e5", "--", "1" * 3999, "1" * 5000, "9" * 400, "30.4.1", "30 .4", "\ud800", "3\x00"),
    *("-1e-3", "1e6", "1e300", "1e-301", "\x1b[31m1\x1b[0m", "1\n2", "½", "30.4f", "1e+", "+-1", "1**2", "__import__"),
)
NOT_SPEEDS = st.one_of(
    st.sampled_from(ODD_NUMBERS), WORDS, st.integers(10**6).map(str), st.integers(max_value=0).map(str)
)
NOT_DISTANCES = st.sampled_from(["", "x", "nan", "inf", "0", "-1e-3", "1e400", "pi", "1/0"])
NOT_ANGLES = st.one_of(
    WORDS, st.integers(10**6).map(str), st.sampled_from(["", "nan", "inf", "pi/2", "1e999", "1\x00"])
)
NOT_COUNTS = st.one_of(
    st.sampled_from(["", "0", "-1", "1e3", "3.5", "nan", "0x10", "1" * 5000, "99999999999999999999", "1\x00", "½"]),
    WORDS,
    st.integers(10**9).map(str),
    st.integers(max_value=0).map(str),
)
NOT_NAMES = st.one_of(
    WORDS, st.sampled_from(["", "../../etc/passwd", "x" * 5000, "\x1b]0;x\x07", "\ud800", "a\nb", "\0"])
)
NOT_EXECUTORS = st.one_of(NOT_NAMES, st.just("dask://\0"), st.just("dask://"))
NOT_FOLDERS = st.sampled_from(["", "/dev/null/x", "/proc/nothing", "a\0b", "x" * 5000, "file", "file/below", "loop/x"])
NOT_TARGETS = st.sampled_from(
    ["", ".", "/dev/null", "nowhere/x.csv", "a\0.csv", "x" * 5000 + ".csv", "folder", "folder/", "file/x.csv", "pipe"]
)
NOT_SOURCES = st.sampled_from(
    [
        "",
        ".",
        "/dev/null",
        "/dev/zero",
        "nowhere.toml",
        "a\0.toml",
        "x" * 5000 + ".toml",
        "folder",
        "pipe",
        "loop",
        "./file",
        "../../../../../../etc/passwd",
        "/proc/self/mem",
        "~/.toml",
        "\ud800.toml",
        "huge.toml",
        "link.toml",
    ]
)


@dataclass(frozen=True)
class Shape:
    """A command that is right, and for each of its options what would be wrong for it."""

    words: tuple[str, ...]
    options: dict[str, tuple[str, st.SearchStrategy[str]]] = field(default_factory=dict)  #: name -> (right, wrong)
    arguments: tuple[tuple[str, st.SearchStrategy[str]], ...] = ()


_COMMON = {
    "--parameters": ("printed", st.one_of(NOT_SOURCES, NOT_NAMES)),
    "--friction": ("linear", NOT_NAMES),
    "--digits": ("12", NOT_COUNTS),
}
_JOBS = {"--jobs": ("1", NOT_COUNTS)}
_AXES = st.one_of(
    WORDS,
    NOT_NAMES,
    st.builds(
        "{}={}".format, st.sampled_from(["mu", "g", "x"]), st.sampled_from(["", ",", "1:2", "1:2:1", "nan", "1:2:1e3"])
    ),
    st.sampled_from(
        [
            "mu=0:1:999999999",
            "mu=0:1:99999999999",
            "mu=1e-9999:1:1000000",
            "mu=pi:1:3",
            "mu=1:2:3:4",
            "mu=0:1:1000001",
            "omega=30",
            "epsilon=1/0",
            "mu=" + "1," * 3000,
            "mu=1:2:٣",
        ]
    ),
)

#: Every command of the program.
SHAPES: dict[str, Shape] = {
    "verify": Shape(
        ("verify",), {**_COMMON, **_JOBS, "--only": ("omega_crit", NOT_NAMES), "--out": ("out", NOT_FOLDERS)}
    ),
    "scene": Shape(
        ("scene",), {**_COMMON, "--omega-h": ("30.05", NOT_SPEEDS), "--out": ("out", NOT_FOLDERS)}, (("d", NOT_NAMES),)
    ),
    "equilibria": Shape(("equilibria",), {**_COMMON, "--omega": ("30.4", NOT_SPEEDS)}),
    "hopf": Shape(("hopf",), {**_COMMON, "--bautin": ("A", NOT_NAMES.filter(lambda text: text not in ("A", "B")))}),
    "orbit": Shape(("orbit",), {**_COMMON, "--omega": ("30.4", NOT_SPEEDS)}),
    "orbit above": Shape(("orbit",), {**_COMMON, "--above-het": ("0.1", NOT_SPEEDS)}),
    "orbit below": Shape(("orbit", "--rotating"), {**_COMMON, "--below-het": ("0.01", NOT_SPEEDS)}),
    "atlas": Shape(
        ("atlas",),
        {
            **_COMMON,
            **_JOBS,
            "--plane": ("A,Omega", NOT_NAMES),
            "--points": ("5", NOT_COUNTS),
            "--out": ("out", NOT_FOLDERS),
        },
    ),
    "harmonic-balance": Shape(
        ("harmonic-balance",), {**_COMMON, "--omega": ("30.4", NOT_SPEEDS), "--harmonics": ("12", NOT_COUNTS)}
    ),
    "branch": Shape(
        ("branch",),
        {
            **_COMMON,
            "--omegas": ("30.4", NOT_SPEEDS.filter(lambda text: text != "30,4")),
            "--out": ("o.csv", NOT_TARGETS),
        },
    ),
    "heteroclinic": Shape(
        ("heteroclinic",), {**_COMMON, "--method": ("scipy", NOT_NAMES), "--out": ("o.csv", NOT_TARGETS)}
    ),
    "slow-manifold": Shape(
        ("slow-manifold",),
        {
            **_COMMON,
            "--order": ("1", NOT_COUNTS.filter(lambda text: text not in ("0",))),
            "--omega": ("30.4", NOT_SPEEDS),
            "--beta": ("1.2", NOT_ANGLES),
            "--gamma": ("0.3", NOT_ANGLES),
        },
    ),
    "basin margin": Shape(
        ("basin",),
        {
            **_COMMON,
            "--omega": ("31.4", NOT_SPEEDS),
            "--margin": (
                "1.5,1,0",
                st.sampled_from(["", "x", "1,2", "1,2,0,0", "nan,1,0", "4,1,0", "1,1/0,0", "1,1,1e400"]),
            ),
        },
    ),
    "basin": Shape(
        ("basin",),
        {
            **_COMMON,
            **_JOBS,
            "--omega": ("30.4", NOT_SPEEDS),
            "--count": ("4", NOT_COUNTS),
            "--out": ("out", NOT_FOLDERS),
            "--seconds": ("5", st.sampled_from(["nan", "inf", "-1", "0", "4", "1e9", "x", "", "1e400"])),
            "--velocity": ("0", st.sampled_from(["nan", "inf", "-1e4", "x", "", "1e400"])),
        },
    ),
    "bench": Shape(("bench",), {"--only": ("cycle", NOT_NAMES), "--out": ("out", NOT_FOLDERS)}),
    "stress": Shape(("stress",), {**_JOBS, "--only": ("flat", NOT_NAMES)}),
    "certify equilibria": Shape(("certify", "equilibria"), {**_COMMON, "--omega": ("30.4", NOT_SPEEDS)}),
    "certify hopf": Shape(("certify", "hopf"), _COMMON),
    "certify orbit": Shape(
        ("certify", "orbit"), {**_COMMON, "--omega": ("30.4", NOT_SPEEDS), "--certificate": ("c.json", NOT_TARGETS)}
    ),
    "certify interval": Shape(
        ("certify", "orbit"),
        {
            "--omega": ("30.4", NOT_SPEEDS),
            "--radius": ("1e-3", NOT_DISTANCES),
        },
    ),
    "certify branch": Shape(
        ("certify", "branch"), {**_COMMON, **_JOBS, "--at": ("A^in", st.one_of(NOT_SOURCES, NOT_NAMES))}
    ),
    "certify branch as one curve": Shape(
        ("certify", "branch"),
        {
            **_JOBS,
            "--to": ("3", st.one_of(NOT_ANGLES, st.sampled_from(["0", "-1", "3.1416"]))),
            "--arcs": ("arcs", NOT_TARGETS),
            "--out": ("out", NOT_FOLDERS),
            "--executor": ("serial", NOT_EXECUTORS),
        },
    ),
    "certify branch with a certificate": Shape(("certify", "branch"), {"--certificate": ("c.json", NOT_TARGETS)}),
    "certify check": Shape(("certify", "check"), _JOBS, (("c.json", NOT_SOURCES),)),
    "certify fold": Shape(("certify", "orbit", "--at-fold"), {"--fold": ("1", NOT_COUNTS)}),
    "certify heteroclinic": Shape(
        ("certify", "heteroclinic"),
        {
            **_COMMON,
            "--near": ("30.05", NOT_SPEEDS),
            "--cycles": ("1e-3", NOT_DISTANCES),
            "--certificate": ("c.json", NOT_TARGETS),
        },
    ),
    "reference list": Shape(
        ("reference", "list"), {}, (("printed", NOT_NAMES.filter(lambda text: text and not text.startswith("-"))),)
    ),
    "reference show": Shape(("reference", "show"), {}, (("printed/linear/hopf/point/period", NOT_NAMES),)),
    "reference check": Shape(
        ("reference", "check"),
        {
            **_JOBS,
            "--data": ("data", NOT_FOLDERS),
            "--sample": ("0", st.sampled_from(["-1", "x", "", "1.5", "nan"])),
            "--seed": ("0", st.sampled_from(["x", "", "1.5", "nan"])),
        },
    ),
    "reference mistakes": Shape(("reference", "mistakes"), {"--data": ("data", NOT_FOLDERS)}),
    "reference prove": Shape(("reference", "prove"), {**_JOBS, "--data": ("data", NOT_FOLDERS)}),
    "reference generate": Shape(
        ("reference", "generate"),
        {**_JOBS, "--only": ("hopf", NOT_NAMES), "--set": ("printed", NOT_NAMES), "--out": ("out", NOT_FOLDERS)},
    ),
    "conformance questions": Shape(
        ("conformance", "questions"),
        {"--set": ("printed", NOT_NAMES), "--friction": ("linear", NOT_NAMES), "--levels": ("3", NOT_COUNTS)},
        (("q.csv", st.one_of(NOT_TARGETS, st.just("answered.csv"), st.just("file.csv"))),),
    ),
    "conformance questions, fresh": Shape(
        ("conformance", "questions"),
        {"--states": ("2", NOT_COUNTS), "--seed": ("7", NOT_COUNTS.filter(lambda text: text != "0"))},
        (("q.csv", NOT_TARGETS),),
    ),
    "conformance grade": Shape(
        ("conformance", "grade"),
        {
            "--from": ("doubles", NOT_NAMES),
            "--html": ("o.html", NOT_TARGETS),
            "--csv": ("o2.csv", NOT_TARGETS),
            "--badge": ("o.svg", NOT_TARGETS),
            "--require": ("4", NOT_COUNTS),
            "--expected-failures": ("expected", NOT_SOURCES),
        },
        (("answered.csv", NOT_SOURCES),),
    ),
    "conformance run": Shape(
        ("conformance", "run"),
        {
            "--set": ("printed", NOT_NAMES),
            "--friction": ("linear", NOT_NAMES),
            "--levels": ("3", NOT_COUNTS),
            "--limit": ("9", st.sampled_from(["", "x", "nan", "inf", "0", "-1", "1e9", "1e400"])),
            "--out": ("out", NOT_FOLDERS),
            "--from": ("doubles", NOT_NAMES),
            "--html": ("o.html", NOT_TARGETS),
            "--csv": ("o2.csv", NOT_TARGETS),
            "--badge": ("o.svg", NOT_TARGETS),
            "--require": ("4", NOT_COUNTS),
            "--expected-failures": ("expected", NOT_SOURCES),
        },
        (("cat", NOT_SOURCES),),  # none of them a program
    ),
    "conformance run, fresh": Shape(
        ("conformance", "run"),
        {"--states": ("2", NOT_COUNTS), "--seed": ("7", NOT_COUNTS.filter(lambda text: text != "0"))},
        (("cat", NOT_SOURCES),),
    ),
    "conformance compare": Shape(
        ("conformance", "compare"),
        {"--from": ("doubles", NOT_NAMES)},
        (("answered.csv", NOT_SOURCES), ("answered.csv", NOT_SOURCES)),
    ),
    "conformance client": Shape(("conformance", "client"), {}, (("octave", NOT_NAMES),)),
    "conformance grader": Shape(("conformance", "grader"), {}, (("octave", NOT_NAMES),)),
    "conformance guide": Shape(("conformance", "guide"), {}),
    "sweep": Shape(
        ("sweep",),
        {
            **_COMMON,
            **_JOBS,
            "--over": ("mu=0.3", _AXES),
            "--out": ("o.csv", st.one_of(NOT_TARGETS, st.just("x.txt"))),
            "--executor": ("serial", NOT_EXECUTORS),
        },
        (("hopf", NOT_NAMES),),
    ),
}

#: Values of every Python type that no parameter of a public function may take.
NO_OBJECTS: tuple[Any, ...] = (
    *(None, b"30.4", [], [30.4], {}, set(), object(), 1j, len, int, ..., NotImplemented, range(3), iter(())),
    *(Exception("x"), memoryview(b"x"), frozenset({1}), True, False),
)
NO_NUMBERS: tuple[Any, ...] = (
    *("", "abc", "nan", "1e99999", "\ud800", "\0", "1" * 5000, float("nan"), float("inf"), -float("inf")),
    *(Decimal("nan"), Decimal("sNaN"), Decimal("1e999999"), *NO_OBJECTS),
)
NO_SPEEDS = (*NO_NUMBERS, 0, -1, 10**6, 10**400, -(10**400), 1e300, Fraction(1, 10**5000), "pi", "pi/2", "1e-9999")
NO_COUNTS = (*NO_NUMBERS, 0, -1, 10**9, 10**400, -(10**400), 1e300, Fraction(1, 3), "12", 3.5)


@dataclass
class Ran:
    """What a command did."""

    status: int
    out: str
    err: str
    seconds: float  #: of this process's CPU


def ran(arguments: list[str]) -> Ran:
    """The command line in this process; anything that it raises is a fault of the program."""
    out, err = io.StringIO(), io.StringIO()
    begin = time.process_time()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        status = main(arguments)
    return Ran(status, out.getvalue(), err.getvalue(), time.process_time() - begin)


_LINE = re.compile(r"[^\n]{1,1020}\n")


def assert_refused(arguments: list[str]) -> Ran:
    done = ran(arguments)
    assert done.status == 2, (arguments, done)
    assert done.out == "", (arguments, done)
    assert _LINE.fullmatch(done.err), (arguments, done)
    assert done.err.rstrip("\n").isprintable(), (arguments, done)
    return done


def furnished(folder: Path) -> Path:
    """A folder with things that are in the way: files, folders, pipes, links in a circle, a huge file."""
    import os

    (folder / "folder").mkdir(parents=True)
    (folder / "file").write_text("mine")
    (folder / "file.csv").write_text("mine,too\n1,2\n")
    (folder / "answered.csv").write_text("id,answer\nprinted/linear/hopf/point/omega_crit,30.9\n")
    (folder / "expected").write_text("printed/linear/hopf/*\n")
    (folder / "loop").symlink_to(folder / "loop")
    (folder / "link.toml").symlink_to("/etc/passwd")
    os.mkfifo(folder / "pipe")
    with open(folder / "huge.toml", "wb") as stream:
        stream.truncate(1 << 30)
    return folder


def contents(folder: Path) -> dict[str, object]:
    """Names and contents of everything below a folder; small files only are read."""
    found: dict[str, object] = {}
    for path in sorted(folder.rglob("*")):
        plain = path.is_file() and not path.is_symlink() and path.stat().st_size < 1_000_000
        found[str(path.relative_to(folder))] = path.read_bytes() if plain else path.lstat().st_mode
    return found
