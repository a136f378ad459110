"""Programs for other languages, and the guide, come out of the command line as they went in."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.command_line import answer, printed
from tippedisk_verify.commands.conformance_sources import CLIENTS, FOLDER, GRADERS

DOCS = Path(__file__).parents[2] / "docs"
GUIDE = DOCS / "grading.md"


@pytest.mark.parametrize(
    ("command", "language", "file"),
    [
        *(("client", *item) for item in CLIENTS.items()),
        *(("grader", *item) for item in GRADERS.items()),
    ],
)
def test_programs_are_printed(command: str, language: str, file: str) -> None:
    text = printed(f"conformance {command} {language}")
    assert text.startswith((FOLDER / file).read_text())
    if file.endswith(".py"):
        compile(text, file, "exec")
    assert answer(f"conformance {command} {language}")["file"] == file


def test_the_guide_is_printed_and_names_every_client() -> None:
    assert printed("conformance guide") == "\n".join(
        page.read_text() for page in sorted(DOCS.glob("grading*.md"))
    )
    for language in CLIENTS:
        assert f"| `{language}` |" in GUIDE.read_text()
