"""What a kept result is named by: it changes with whatever the result depends on."""

from __future__ import annotations

import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

from tests.dask_cluster import changed_package, surroundings
from tippedisk_verify import provenance
from tippedisk_verify.provenance import DRAWING, code_version, key

# Dependencies that no number and no picture comes from.
PRESENTATION = {"click", "rich", "jinja2", "fastjsonschema"}
PYPROJECT = Path(__file__).parent.parent / "pyproject.toml"


def test_a_key_changes_with_inputs_packages_and_processor(monkeypatch: pytest.MonkeyPatch) -> None:
    seen = [key({"digits": 12}), key({"digits": 13}), key({"digits": 12}, DRAWING)]
    monkeypatch.setattr(provenance, "processor", lambda: "another")
    seen.append(key({"digits": 12}))
    monkeypatch.undo()
    monkeypatch.setattr(provenance, "_installed", lambda package: "0")
    seen.append(key({"digits": 12}))
    monkeypatch.undo()
    monkeypatch.setattr(provenance, "code_version", lambda: "another")
    seen.append(key({"digits": 12}))
    assert len(set(seen)) == len(seen)
    monkeypatch.undo()
    assert key({"digits": 12}) == seen[0]


def test_a_process_says_which_code_it_began_with(tmp_path: Path) -> None:
    """Not what is installed later while the process still has the old code."""
    other = changed_package(tmp_path, "theory/hopf.py", "from __future__", "# other words\nfrom __future__")
    path = other / "tippedisk_verify" / "theory" / "hopf.py"
    program = (
        "from tippedisk_verify.provenance import code_version\nbefore = code_version()\n"
        f"open({str(path)!r}, 'a').write('# and more')\nassert code_version() == before\nprint(before)"
    )

    def told() -> str:
        return subprocess.run(
            [sys.executable, "-c", program], capture_output=True, text=True, check=True, cwd=tmp_path,
            env=surroundings(other),
        ).stdout.strip()  # fmt: skip

    assert len({code_version(), told(), told()}) == 3


def test_every_dependency_is_classified() -> None:
    """A new dependency must be named in one of the lists: as what numbers depend on, or as what they do not."""
    project = tomllib.loads(PYPROJECT.read_text(encoding="utf-8"))["project"]
    required = [*project["dependencies"], *project["optional-dependencies"]["certify"]]
    names = {text.split(">")[0].split("<")[0].split("=")[0].strip() for text in required}
    assert names == set(DRAWING) | PRESENTATION
