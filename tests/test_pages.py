"""The README and the pages of the site: their code runs and prints what they show."""

from __future__ import annotations

import contextlib
import io
import itertools
import json
import re
import shlex
from pathlib import Path

import click
import pytest

import tippedisk_verify as tv
from tests.test_commands import parsed
from tippedisk_verify.cli import cli

ROOT = Path(__file__).parent.parent
README = (ROOT / "README.md").read_text(encoding="utf-8")
INDEX = (ROOT / "docs" / "index.md").read_text(encoding="utf-8")
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").rglob("*.md"))]


def commands(page: str) -> list[str]:
    """Return the commands of a page without ``tippedisk-verify``.

    They stand in code between backticks, or on indented lines.
    """
    code = [*re.findall(r"`([^`\n]+)`", page), *re.findall(r"^ {4}(.+)$", page, re.MULTILINE)]
    return [
        command
        for line in code
        for command in re.findall(
            r"tippedisk-verify ((?:(?! &&| >| "
            r"\|).)+)",
            line,
        )
    ]


ROWS = commands("\n".join(line for line in README.splitlines() if line.startswith("| ")))


# -------------------------------------------------------------------------------------- the README
def test_the_readme_is_short() -> None:
    assert len(README.splitlines()) <= 130
    assert len(ROWS) == 5


def test_the_lines_of_python_print_their_comments() -> None:
    """Run the lines, which are one of the examples, so that mypy reads them too.

    Three dots stand for further digits.
    """
    (shown,) = re.findall(r"```python\n(.*?)```", README, re.DOTALL)
    assert (
        shown
        == (ROOT / "examples" / "from_python.py").read_text(encoding="utf-8").partition("\n\n")[2]
    )
    lines = [line for line in shown.splitlines() if line]
    assert len(lines) == 10
    names: dict[str, object] = {}
    for line in lines:
        printed = io.StringIO()
        with contextlib.redirect_stdout(printed):
            exec(line, names)
        expected = line.partition("  # ")[2]
        assert printed.getvalue().startswith(expected.removesuffix("...")), line
        assert bool(expected) == line.startswith("print")


def test_the_disk_file_of_the_readme_is_table_1(tmp_path: Path) -> None:
    lines = re.findall(r"^    (\w+ = \".*\")$", README, re.MULTILINE)
    (tmp_path / "disk.toml").write_text("\n".join(lines))
    assert (
        tv.Disk.read(tmp_path / "disk.toml").decimals() | {"C": tv.PRINTED.decimals()["C"]}
        == tv.Disk("table1").decimals()
    )


def test_continuous_integration_runs_the_readmes_test_command() -> None:
    (command,) = re.findall(r"^    python3 -m venv \.venv && (.*pytest)$", README, re.MULTILINE)
    install, test = command.replace(".venv/bin/", "").split(" && ")
    script = (
        (ROOT / ".ci" / "run")
        .read_text(encoding="utf-8")
        .replace('"$work/venv/bin/', "")
        .replace('"', "")
    )
    assert test in script
    assert install.replace("[test]", "[test,docs]") in script
    assert "run: .ci/run" in (ROOT / ".github" / "workflows" / "ci.yml").read_text(encoding="utf-8")


# --------------------------------------------------------------------------------------- all pages
@pytest.mark.parametrize("path", PAGES, ids=lambda path: path.relative_to(ROOT).as_posix())
def test_every_command_of_a_page_is_valid(path: Path) -> None:
    """Check name, options and number of arguments; words in capitals are placeholders."""
    for command in commands(path.read_text(encoding="utf-8")):
        words = shlex.split(command)
        if len(words) > 1 and not words[0].isupper():
            parsed(words)


def test_every_command_has_its_place_on_the_page_of_commands() -> None:
    shown = {
        command.split()[0]
        for command in commands((ROOT / "docs" / "commands.md").read_text(encoding="utf-8"))
    }
    assert shown == {*cli.list_commands(click.Context(cli)), "COMMAND"}


@pytest.mark.parametrize("path", PAGES, ids=lambda path: path.name)
def test_no_line_in_a_paragraph_is_taken_for_a_list_or_a_heading(path: Path) -> None:
    """Markdown ends a paragraph at a line that begins with "1. ", "- ", "+ " or "# "."""
    text = re.sub(
        r"^```.*?^```", "", path.read_text(encoding="utf-8"), flags=re.DOTALL | re.MULTILINE
    )
    for before, line in itertools.pairwise(text.splitlines()):
        in_prose = before and not re.match(r"\s|[-+*|#>:%$]|\d+\.|```", before)
        assert not (in_prose and re.match(r"(1\.|[-+*>]|#+) ", line)), line


@pytest.mark.parametrize("path", PAGES, ids=lambda path: path.relative_to(ROOT).as_posix())
def test_links_lead_to_files(path: Path) -> None:
    for target in re.findall(r"\]\(([^)#:]+)(?:#[^)]*)?\)", path.read_text(encoding="utf-8")):
        assert (path.parent / target).exists(), target


def test_every_public_name_of_python_has_an_example() -> None:
    """Check for a cell that runs as the site is built, for a disk's methods as well."""
    pages = [
        path.read_text(encoding="utf-8")
        for path in (ROOT / "docs" / "reference").glob("python*.md")
    ]
    cells = "\n".join(re.findall(r"```\{code-cell\}\n(.*?)```", "\n".join(pages), re.DOTALL))
    assert {name for name in tv.__all__ if not re.search(rf"\btv\.{name}\b", cells)} == set()
    methods = {
        name
        for name, value in vars(tv.Disk).items()
        if not name.startswith("_") and value is not None
    }
    assert {name for name in methods if not re.search(rf"\.{name}\b", cells)} == set()


def test_the_numbers_of_the_first_page() -> None:
    """Compare each number in the table with the true one, rounded to as many places."""
    from tippedisk_verify.audit.claims import rounds_to
    from tippedisk_verify.numbers.measured import Measured
    from tippedisk_verify.theory.equilibria import stiff_eigenvalue_estimate
    from tippedisk_verify.theory.one_harmonic_law import chi

    rows = {
        cells[1].split()[0].rstrip(","): cells[3:5]
        for line in INDEX.splitlines()
        if len(cells := line.split("|")) == 6
    }
    for place, (parameters, set_name) in enumerate(
        ((tv.PRINTED, "printed"), (tv.CALIBRATED, "calibrated"))
    ):
        truths = {
            "Omega_crit": tv.omega_crit(parameters, 25),
            "T_crit": tv.period_crit(parameters, 25),
            "A_33": Measured.of(stiff_eigenvalue_estimate(parameters), 0),
            "chi": Measured.of(chi(parameters.rational_constants(), "printed"), 0),
            "Omega_h": tv.reference(f"{set_name}/linear/heteroclinic/point/omega_h").measured(),
        }
        for name, truth in truths.items():
            assert rounds_to(truth, rows[name][place].strip()) is True, (name, parameters.name)


# ------------------------------------------------------------------------------------- the release
def test_the_version_is_the_same_everywhere() -> None:
    """Between releases, the package has the version of the next one and files name the last one."""
    changes = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    released = re.findall(r"^## (\d+\.\d+\.\d+) ", changes, re.MULTILINE)[0]
    if tv.__version__ != released:
        coming = tv.__version__.removesuffix(".dev0")
        assert tv.__version__ == f"{coming}.dev0"
        assert [*map(int, coming.split("."))] > [*map(int, released.split("."))]
        assert "\n## Unreleased\n" in changes
    assert f"version = {{{released}}}" in README
    citation = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    assert f"\nversion: {released}\n" in citation
    assert json.loads((ROOT / ".zenodo.json").read_text(encoding="utf-8"))["version"] == released
    dates = re.findall(r"^date-released: (\S+)$", citation, re.MULTILINE)
    assert dates == re.findall(rf"^## {re.escape(released)} \((\S+)\)$", changes, re.MULTILINE)
