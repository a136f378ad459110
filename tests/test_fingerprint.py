"""A fingerprint changes with what the result depends on, and with nothing else."""

from __future__ import annotations

import json
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

from tests.dask_cluster import changed_package, surroundings
from tippedisk_verify import fingerprint as module
from tippedisk_verify.audit.catalogue import CLAIMS, home_of
from tippedisk_verify.figures import catalogue
from tippedisk_verify.fingerprint import DRAWING, closure, fingerprint, unlike

# Dependencies that no number and no picture comes from.
PRESENTATION = {"click", "rich", "jinja2", "fastjsonschema"}
PYPROJECT = Path(__file__).parent.parent / "pyproject.toml"


@pytest.fixture
def house(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """A package of a few modules in place of this one; gives a function that writes one of them."""

    def write(name: str, text: str) -> None:
        path = tmp_path / name
        path.parent.mkdir(exist_ok=True)
        path.write_text(text, encoding="utf-8")
        for cached in (module._text, module._content, module._imports):
            cached.cache_clear()

    monkeypatch.setattr(module, "_ROOT", tmp_path)
    write("__init__.py", "from tippedisk_verify.unrelated import x")
    write("room/__init__.py", "from tippedisk_verify import shared")
    write("room/claim.py", "from __future__ import annotations\ndef f():\n    from .formula import g\n    return g()\n")
    write("room/formula.py", "import math, tippedisk_verify.deep\nfrom typing import TYPE_CHECKING\n"
          "if TYPE_CHECKING:\n    from tippedisk_verify.unrelated import x\n")  # fmt: skip
    for name in ("shared", "deep", "unrelated"):
        write(f"{name}.py", "x = 1\n")
    yield write
    for cached in (module._text, module._content, module._imports):
        cached.cache_clear()


def test_the_closure_follows_every_kind_of_import(house) -> None:
    names = {f"tippedisk_verify.{name}" for name in ("room", "room.claim", "room.formula", "shared", "deep")}
    assert set(closure("tippedisk_verify.room.claim")) == names


def test_it_changes_with_code_it_depends_on_only(house) -> None:
    def now() -> str:
        return fingerprint("tippedisk_verify.room.claim", {"digits": 12})

    before = now()
    house("unrelated.py", "x = 2\n")
    assert now() == before
    for name in ("room/claim.py", "room/formula.py", "room/__init__.py", "deep.py", "shared.py"):
        house(name, "# another line\n" + (module._ROOT / name).read_text())
        assert now() != before, name
        before = now()
    assert fingerprint("tippedisk_verify.room.claim", {"digits": 13}) != before


def test_it_changes_with_versions_and_processor(monkeypatch: pytest.MonkeyPatch) -> None:
    home = home_of("omega_crit")
    before = fingerprint(home, {})
    assert fingerprint(home, {}) == before
    assert fingerprint(home, {}, DRAWING) != before
    monkeypatch.setattr(module, "_machine", lambda: ("another",))
    assert fingerprint(home, {}) != before
    monkeypatch.undo()
    monkeypatch.setattr(module, "_installed", lambda package: "0")
    assert fingerprint(home, {}) != before


def test_an_origin_is_that_of_the_code_that_runs(tmp_path: Path) -> None:
    """Not of what is installed later while the process still has the old code; the processor is not in it."""
    other = changed_package(tmp_path, "theory/hopf.py", "from __future__", "# other words\nfrom __future__")
    program = (
        "import sys, json\nfrom tippedisk_verify.fingerprint import origin\n"
        "before = origin('tippedisk_verify.theory.hopf')\n"
        "if len(sys.argv) > 1: open(sys.argv[1], 'a').write('# and more')\n"
        "assert origin('tippedisk_verify.theory.hopf') == before\nprint(json.dumps(before))"
    )
    path = other / "tippedisk_verify" / "theory" / "hopf.py"

    def told(*arguments: str) -> dict[str, str]:
        run = subprocess.run(
            [sys.executable, "-c", program, *arguments], capture_output=True, check=True, cwd=tmp_path,
            env=surroundings(other),
        )  # fmt: skip
        return json.loads(run.stdout)

    mine, first, second = module.origin("tippedisk_verify.theory.hopf"), told(str(path)), told()
    assert len({mine["code"], first["code"], second["code"]}) == 3
    assert mine | {"code": ""} == first | {"code": ""} == second | {"code": ""}
    assert unlike(mine, mine) == ""
    assert "changed code" in unlike(first, mine)
    assert unlike({}, mine).startswith("tippedisk_verify unknown instead of")
    assert set(mine) == {"tippedisk_verify", "code", *module.NUMERICAL}


def test_every_dependency_is_classified() -> None:
    """A new dependency must be named in one of the lists: as what numbers depend on, or as what they do not."""
    project = tomllib.loads(PYPROJECT.read_text(encoding="utf-8"))["project"]
    names = {text.split(">")[0].split("<")[0].split("=")[0].strip() for text in project["dependencies"]}
    assert names == set(DRAWING) | PRESENTATION


@pytest.mark.parametrize(
    "claim",
    [
        *("omega_crit", "attraction", "homoclinic_identified"),
        *(
            pytest.param(name, marks=pytest.mark.slow)
            for name in ("table_2", "engines_agree", "smooth_same_asymptotics")
        ),
    ],
)
def test_nothing_runs_that_the_closure_does_not_hold(claim: str) -> None:
    """What a claim's module really imports while it examines the claim."""
    home = home_of(claim)
    program = (
        "import sys\nfrom importlib import import_module\n"
        f"home = import_module('{home}')\n"
        "from tippedisk_verify.audit.claims import Audit, examined\n"
        "from tippedisk_verify.flow.taylor import Taylor\n"
        "from tippedisk_verify.model.parameters import PRINTED\n"
        "claims = next(value for name, value in vars(home).items() if name.endswith('_CLAIMS'))\n"
        f"(claim,) = [claim for claim in claims if claim.name == '{claim}']\n"
        "assert examined(Audit(PRINTED, Taylor()), claim).verdict.value != 'undecided'\n"
        "print('\\n'.join(name for name in sys.modules if name.startswith('tippedisk_verify.')))"
    )
    run = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert set(run.stdout.split()) <= set(closure(home))


def test_homes_are_where_things_are_made() -> None:
    for claim in CLAIMS:
        assert claim.name in Path(module._path(home_of(claim.name))).read_text() or claim.name.startswith("scene_")
    for exhibit in catalogue.EXHIBITS:
        assert exhibit.draw.__module__ == catalogue.home_of(exhibit.name)
