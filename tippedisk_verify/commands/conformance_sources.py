"""The commands `conformance client|grader|guide`, which print programs in other languages."""

from __future__ import annotations

import click

from tippedisk_verify.commands.definition import OutputOptions, command
from tippedisk_verify.conformance import CLIENTS_FOLDER as FOLDER
from tippedisk_verify.conformance import client_text
from tippedisk_verify.errors import InputError
from tippedisk_verify.support.files import printable

__all__ = ["CLIENTS", "FOLDER", "GRADERS", "client", "grader", "guide"]

CLIENTS = {
    "auto": "auto.f90",  # continues cycles; it does not answer a sheet
    "c": "client.c",
    "fortran": "client.f90",
    "javascript": "client.mjs",
    "julia": "client.jl",
    "octave": "tippedisk_answers.m",
    "python": "client.py",
}
GRADERS = {"javascript": "grade.mjs", "octave": "tippedisk_grade.m"}


@command(
    "Print a program that answers a sheet; `octave` also runs in MATLAB, and `auto` continues "
    "cycles in AUTO-07p."
)
@click.argument("language", metavar="|".join(CLIENTS))
def client(output: OutputOptions, language: str) -> int:
    return _print_files(output, language, CLIENTS)


@command("Print a program in this language that grades answers with the table of reference data.")
@click.argument("language", metavar="|".join(GRADERS))
def grader(output: OutputOptions, language: str) -> int:
    return _print_files(output, language, GRADERS)


def _print_files(output: OutputOptions, language: str, files: dict[str, str]) -> int:
    if language not in files:
        raise InputError(
            f"there is no program in '{printable(language)[:40]}': use {', '.join(files)}"
        )
    text = client_text(files[language])
    output.show(
        {"language": language, "file": files[language], "text": text}, [text.removesuffix("\n")]
    )
    return 0


@command("Print the guide to grading an implementation: the pages docs/grading*.md.")
def guide(output: OutputOptions) -> int:
    packed = FOLDER.parent / "guide"
    pages = sorted((packed if packed.exists() else FOLDER.parents[2] / "docs").glob("grading*.md"))
    text = "\n".join(page.read_text(encoding="utf-8") for page in pages)
    output.show({"file": pages[0].name, "text": text}, [text.removesuffix("\n")])
    return 0
