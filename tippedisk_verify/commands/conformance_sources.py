"""The commands `conformance client|grader|guide`: what the package carries for programs in other languages."""

from __future__ import annotations

import click

from tippedisk_verify.commands.common import Common, plain_options, print_result
from tippedisk_verify.conformance import CLIENTS_FOLDER as FOLDER
from tippedisk_verify.conformance import client_text
from tippedisk_verify.errors import InputError
from tippedisk_verify.files import printable

__all__ = ["CLIENTS", "FOLDER", "GRADERS", "client", "grader", "guide"]

CLIENTS = {
    "auto": "auto.f90",  # continues cycles, and answers no sheet
    "c": "client.c",
    "fortran": "client.f90",
    "javascript": "client.mjs",
    "julia": "client.jl",
    "octave": "tippedisk_answers.m",
    "python": "client.py",
}
GRADERS = {"javascript": "grade.mjs", "octave": "tippedisk_grade.m"}


@click.command()
@click.argument("language", metavar="|".join(CLIENTS))
@plain_options
def client(common: Common, language: str) -> int:
    """Print a program that answers a sheet; `octave` is MATLAB as well, and `auto` continues cycles in AUTO-07p."""
    return _printed(common, language, CLIENTS)


@click.command()
@click.argument("language", metavar="|".join(GRADERS))
@plain_options
def grader(common: Common, language: str) -> int:
    """Print a program in this language that grades answers by the reference data's table."""
    return _printed(common, language, GRADERS)


def _printed(common: Common, language: str, files: dict[str, str]) -> int:
    if language not in files:
        raise InputError(f"there is none in '{printable(language)[:40]}': use {', '.join(files)}")
    text = client_text(files[language])
    return _shown(common, {"language": language, "file": files[language], "text": text})


@click.command()
@plain_options
def guide(common: Common) -> int:
    """Print how to have an implementation graded: the pages docs/grading*.md."""
    packed = FOLDER.parent / "guide"
    pages = sorted((packed if packed.exists() else FOLDER.parents[2] / "docs").glob("grading*.md"))
    text = "\n".join(page.read_text(encoding="utf-8") for page in pages)
    return _shown(common, {"file": pages[0].name, "text": text})


def _shown(common: Common, told: dict[str, str]) -> int:
    print_result(common, told, [told["text"].removesuffix("\n")])
    return 0
