"""The house: what importing loads, which room imports which, and the reading guide as an example."""

from __future__ import annotations

import ast
import doctest
import subprocess
import sys
from pathlib import Path

import pytest

import tippedisk_verify as tv

ROOT = Path(tv.__file__).parent
# Each room and the rooms it may import from.
ALLOWED = {
    "model": {"errors", "cache", "model"},  # compiled code is kept where results are
    "theory": {"errors", "model", "theory"},
    "flow": {"errors", "model", "flow"},
    "orbits": {"errors", "model", "theory", "flow", "orbits"},
    "checker": {"checker"},
    "certified": {"errors", "model", "checker", "certified"},
    "audit": {"errors", "model", "theory", "flow", "orbits", "audit"},
    "reference_values": {
        *("errors", "files", "checksums", "fingerprint", "parallel"),
        *("model", "theory", "flow", "orbits", "certified", "reference_values"),
    },
    "conformance": {"errors", "files", "interrupts", "web", "model", "theory", "reference_values", "conformance"},
    "bench": {
        *("errors", "cache", "interrupts", "fingerprint", "parallel", "__version__"),
        *("model", "theory", "flow", "orbits", "bench"),
    },
    "stress": {"errors", "model", "theory", "flow", "orbits", "stress"},
    "figures": {"errors", "files", "model", "theory", "flow", "orbits", "certified", "audit", "bench", "figures"},
    "report": {
        *("errors", "files", "cache", "fingerprint", "web", "__version__"),
        *("model", "theory", "flow", "orbits", "audit", "bench", "figures", "report"),
    },
}


@pytest.mark.parametrize("room", ALLOWED)
def test_rooms_import_only_from_rooms_before_them(room: str) -> None:
    for path in (ROOT / room).rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            names = []
            if isinstance(node, ast.ImportFrom) and node.module:
                names = [node.module]
            elif isinstance(node, ast.Import):
                names = [alias.name for alias in node.names]
            for name in names:
                parts = name.split(".")
                if parts[0] == "tippedisk_verify" and len(parts) > 1:
                    assert parts[1] in ALLOWED[room], f"{path.name} imports {name}"
                if parts[0] in ("matplotlib", "mpl_toolkits"):
                    # A limit cycle that is told to plot itself opens axes if it is given none.
                    assert room == "figures" or path.name == "cycles.py", f"{path.name} imports {name}"
                if parts[0] == "heyoka":
                    # What starting is measured against is heyoka and nothing else.
                    assert path.name in ("precision.py", "bare_builds.py"), f"{path.name} imports heyoka by itself"


def test_importing_loads_nothing_heavy() -> None:
    program = (
        "import sys, tippedisk_verify, tippedisk_verify.model.equations, tippedisk_verify.cli\n"
        "print([m for m in ('heyoka', 'scipy', 'matplotlib', 'mpmath', 'numpy', 'rich') if m in sys.modules])"
    )
    printed = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True).stdout
    assert printed.strip() == "[]"


def test_scenes_without_a_folder_need_no_matplotlib() -> None:
    program = (
        "import sys; from tippedisk_verify.cli import main\n"
        "status = main(['scene', 'd', '--json', '--quiet'])\n"
        "sys.exit(status or 'matplotlib' in sys.modules)"
    )
    assert subprocess.run([sys.executable, "-c", program], capture_output=True, check=False).returncode == 0


def test_a_closed_form_claim_needs_nothing_heavy() -> None:
    program = (
        "import sys; from tippedisk_verify.cli import main\n"
        "assert main(['verify', '--only', 'omega_crit', '--json', '--quiet']) == 0\n"
        "print([m for m in ('heyoka', 'scipy', 'matplotlib') if m in sys.modules], file=sys.stderr)"
    )
    run = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert run.stderr.strip() == "[]"


def test_without_heyoka_what_needs_it_says_so_in_one_line() -> None:
    """As on a platform that it has no wheels for; closed forms are to be had there too."""
    program = (
        "import sys; sys.modules['heyoka'] = None; from tippedisk_verify.cli import main\n"
        "assert main(['hopf', '--quiet']) == 0\n"
        "sys.exit(main(['heteroclinic', '--quiet', '--method', 'bisection']))"
    )
    run = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=False)
    assert run.returncode == 1
    assert run.stderr.startswith("tippedisk-verify: a library is missing: heyoka")
    assert "Linux" in run.stderr
    assert run.stderr.count("\n") == 1


def test_public_names_exist() -> None:
    for name in tv.__all__:
        assert getattr(tv, name) is not None
    assert set(tv.__all__) <= set(dir(tv))
    with pytest.raises(AttributeError):
        _ = tv.nothing  # type: ignore[attr-defined]


def test_the_reading_guide_runs() -> None:
    failed, tried = doctest.testmod(tv)
    assert (failed, tried > 3) == (0, True)
