"""The commands `conformance client|grader|guide`: what the package carries for programs in other languages."""

from __future__ import annotations

from pathlib import Path

import click

from tippedisk_verify.commands.common import Common, plain_options, print_result
from tippedisk_verify.errors import InputError
from tippedisk_verify.files import printable, read_text

__all__ = ["CLIENTS", "FOLDER", "GRADERS", "client", "grader", "guide"]

FOLDER = Path(__file__).resolve().parent.parent / "conformance" / "clients"
CLIENTS = {
    "c": "client.c",
    "fortran": "client.f90",
    "javascript": "client.mjs",
    "julia": "client.jl",
    "octave": "tippedisk_answers.m",
    "python": "client.py",
}
GRADERS = {"javascript": "grade.mjs", "octave": "tippedisk_grade.m"}
_LARGEST = 1_000_000


@click.command()
@click.argument("language", metavar="|".join(CLIENTS))
@plain_options
def client(common: Common, language: str) -> int:
    """Print a program in this language that answers a sheet; `octave` is MATLAB as well."""
    return _printed(common, language, CLIENTS)


@click.command()
@click.argument("language", metavar="|".join(GRADERS))
@plain_options
def grader(common: Common, language: str) -> int:
    """Print a program in this language that grades answers by the table sheet_with_truths.csv."""
    return _printed(common, language, GRADERS)


def _printed(common: Common, language: str, files: dict[str, str]) -> int:
    if language not in files:
        raise InputError(f"there is none in '{printable(language)[:40]}': use {', '.join(files)}")
    return _shown(common, {"language": language}, FOLDER / files[language])


@click.command()
@plain_options
def guide(common: Common) -> int:
    """Print how to have an implementation graded: the pages docs/grading*.md."""
    packed, source = FOLDER.parent / "guide", FOLDER.parents[2] / "docs"
    return _shown(common, {}, *sorted((packed if packed.exists() else source).glob("grading*.md")))


def _shown(common: Common, says: dict[str, str], *files: Path) -> int:
    text = "\n".join(read_text(file, _LARGEST) for file in files)
    print_result(common, says | {"file": files[0].name, "text": text}, [text.removesuffix("\n")])
    return 0
