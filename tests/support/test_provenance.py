"""A fingerprint changes with everything behind a result; a code version is the running code's."""

from __future__ import annotations

import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

from tippedisk_verify.support import provenance
from tippedisk_verify.support.provenance import DRAWING, fingerprint

# Dependencies that no number and no picture comes from.
PRESENTATION = {"click", "rich", "jinja2"}
PYPROJECT = Path(__file__).parents[2] / "pyproject.toml"


@pytest.fixture
def fresh(monkeypatch: pytest.MonkeyPatch):
    """Clear all cached values before and after the test."""
    remembered = (provenance._code, provenance.processor, provenance.versions)

    def forget() -> None:
        for function in remembered:
            function.cache_clear()

    forget()
    yield forget
    monkeypatch.undo()
    forget()


def test_a_fingerprint_changes_with_everything_behind_a_result(
    fresh, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "room").mkdir()
    module = tmp_path / "room" / "module.py"
    module.write_text("x = 1\n")
    monkeypatch.setattr(provenance, "_ROOT", tmp_path)
    found = [
        fingerprint({"digits": 12}),
        fingerprint({"digits": 13}),
        fingerprint({"digits": 12}, DRAWING),
    ]
    assert fingerprint({"digits": 12}) == found[0]
    module.write_text("x = 2\n")
    assert fingerprint({"digits": 12}) == found[0]  # what runs was read before
    for change in (
        lambda: module.rename(module.with_name("other.py")),
        lambda: monkeypatch.setattr("importlib.metadata.version", lambda package: "0"),
        lambda: monkeypatch.setattr(provenance.platform, "machine", lambda: "another"),
        lambda: monkeypatch.setattr(provenance.platform, "python_version", lambda: "4.0"),
        lambda: monkeypatch.setattr("tippedisk_verify.__version__", "0"),
    ):
        fresh()
        found.append(fingerprint({"digits": 12}))
        change()
    fresh()
    found.append(fingerprint({"digits": 12}))
    assert len(set(found)) == len(found)


def test_every_dependency_is_classified() -> None:
    """Check that each dependency is listed either as one on which numbers depend, or as another."""
    project = tomllib.loads(PYPROJECT.read_text(encoding="utf-8"))["project"]
    required = [*project["dependencies"], *project["optional-dependencies"]["certify"]]
    names = {text.split(">")[0].split("<")[0].split("=")[0].strip() for text in required}
    assert names == set(DRAWING) | PRESENTATION


def test_a_code_version_holds_every_computing_module_in_memory() -> None:
    """Check in a new process, as another test may have imported the modules."""
    program = (
        "import sys; from tippedisk_verify.support import provenance; provenance.code_version(); "
        "print(*sys.modules)"
    )
    printed = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=True
    ).stdout
    root = PYPROJECT.parent
    modules = {
        ".".join(path.relative_to(root).with_suffix("").parts).removesuffix(".__init__")
        for package in provenance._COMPUTING
        for path in (root / "tippedisk_verify" / package).rglob("*.py")
    }
    assert len(modules) > 100
    assert modules <= set(printed.split())
