"""Programs for other languages, and the guide, come out of the command line as they went in."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from tippedisk_verify.cli import main
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
def test_programs_are_printed(
    command: str, language: str, file: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["conformance", command, language]) == 0
    printed = capsys.readouterr().out
    assert printed.startswith((FOLDER / file).read_text())
    if file.endswith(".py"):
        compile(printed, file, "exec")
    assert main(["conformance", command, language, "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["file"] == file


def test_the_guide_is_printed_and_names_every_client(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["conformance", "guide"]) == 0
    assert capsys.readouterr().out == "\n".join(
        page.read_text() for page in sorted(DOCS.glob("grading*.md"))
    )
    for language in CLIENTS:
        assert f"| `{language}` |" in GUIDE.read_text()
