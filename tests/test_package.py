"""The house: what importing loads, which room imports which, and the reading guide as an example."""

from __future__ import annotations

import ast
import doctest
import re
import subprocess
import sys
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path

import pytest

import tippedisk_verify as tv

ROOT = Path(tv.__file__).parent
#: The table in CONTRIBUTING.md: the most lines and statements of each room, and the rooms that it may import from.
ROOMS = {
    name.strip(" `"): (int(lines), int(statements), set(imports.replace("`", "").split()))
    for name, lines, statements, imports in re.findall(
        r"^\|(.+)\| *(\d+) *\| *(\d+) *\|(.*)\|$",
        (ROOT.parent / "CONTRIBUTING.md").read_text(encoding="utf-8"),
        re.MULTILINE,
    )
}


def files_of(room: str) -> list[Path]:
    if room == "tests":
        return sorted((ROOT.parent / room).rglob("*.py"))
    return sorted(ROOT.glob("*.py") if room == "single files" else (ROOT / room).rglob("*.py"))


def imported(tree: ast.AST) -> Iterator[str]:
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and node.module:
            yield node.module
        elif isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)


def test_every_room_has_its_row() -> None:
    rooms = {path.parent.relative_to(ROOT).parts[0] for path in ROOT.rglob("*.py") if path.parent != ROOT}
    assert rooms | {"single files", "tests"} == set(ROOMS)


@pytest.mark.parametrize("room", ROOMS)
def test_a_room_weighs_what_its_row_says(room: str) -> None:
    texts = [path.read_text(encoding="utf-8") for path in files_of(room)]
    lines = sum(len(text.splitlines()) for text in texts)
    statements = sum(isinstance(node, ast.stmt) for text in texts for node in ast.walk(ast.parse(text)))
    assert lines <= ROOMS[room][0], f"{room} has {lines} lines: make it lighter, or say in CONTRIBUTING.md what for"
    assert statements <= ROOMS[room][1], f"{room} has {statements} statements: the same"


@pytest.mark.parametrize("room", [room for room in ROOMS if room not in ("commands", "single files", "tests")])
def test_rooms_import_only_from_rooms_before_them(room: str) -> None:
    for path in files_of(room):
        for name in imported(ast.parse(path.read_text(encoding="utf-8"))):
            parts = name.split(".")
            if parts[0] == "tippedisk_verify" and len(parts) > 1:
                assert parts[1] in ROOMS[room][2] | {room}, f"{path.name} imports {name}"
            if parts[0] in ("matplotlib", "mpl_toolkits"):
                # A result that is told to plot itself opens axes if it is given none.
                own = path.name in ("limit_cycle.py", "branch.py")
                assert room == "figures" or own, f"{path.name} imports {name}"
            if parts[0] == "heyoka":
                assert path.name == "precision.py", f"{path.name} imports heyoka by itself"


@pytest.mark.parametrize(
    ("command", "heavy"),
    [
        (None, {"heyoka", "scipy", "matplotlib", "mpmath", "numpy", "rich"}),
        (["verify", "--only", "omega_crit", "--json", "--quiet"], {"heyoka", "scipy", "matplotlib"}),
        (["scene", "d", "--json", "--quiet"], {"matplotlib"}),
    ],
    ids=["import", "closed form", "scene without a folder"],
)
def test_nothing_heavy_is_loaded_for_what_does_not_need_it(command: list[str] | None, heavy: set[str]) -> None:
    program = (
        "import sys, tippedisk_verify.model.equations; from tippedisk_verify.cli import main\n"
        f"assert {command} is None or main({command}) == 0\n"
        f"assert not {heavy} & set(sys.modules), set(sys.modules)"
    )
    subprocess.run([sys.executable, "-c", program], capture_output=True, check=True)


def test_without_heyoka_what_needs_it_says_so_in_one_line() -> None:
    """As on a platform that it has no wheels for; closed forms are to be had there too."""
    program = (
        "import sys; sys.modules['heyoka'] = None; from tippedisk_verify.cli import main\n"
        "assert main(['hopf', '--quiet']) == 0\n"
        "sys.exit(main(['heteroclinic', '--quiet', '--method', 'bisection']))"
    )
    run = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=False)
    assert run.returncode == 1
    assert run.stderr.startswith("tippedisk-verify: a library is missing, or there is no memory for it: heyoka")
    assert "Linux" in run.stderr
    assert run.stderr.count("\n") == 1


def test_public_names_exist() -> None:
    for name in tv.__all__:
        assert getattr(tv, name) is not None
    assert set(tv.__all__) <= set(dir(tv))
    with pytest.raises(AttributeError):
        _ = tv.nothing  # type: ignore[attr-defined]


@pytest.mark.parametrize("name", ["", ".disk", ".model.measured", ".cycles.limit_cycle"])
def test_the_examples_of_docstrings_run(name: str) -> None:
    failed, tried = doctest.testmod(import_module(f"tippedisk_verify{name}"))
    assert (failed, tried > 0) == (0, True)
