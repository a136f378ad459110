"""The modules that importing loads, the public names, and the examples in docstrings."""

from __future__ import annotations

import doctest
import inspect
import subprocess
import sys
from importlib import import_module

import pytest

import tippedisk_verify as tv


@pytest.mark.parametrize(
    ("command", "heavy"),
    [
        (None, {"heyoka", "scipy", "matplotlib", "mpmath", "numpy", "rich"}),
        (
            ["verify", "--only", "omega_crit", "--json", "--quiet"],
            {"heyoka", "scipy", "matplotlib"},
        ),
        (["scene", "d", "--json", "--quiet"], {"matplotlib"}),
    ],
    ids=["import", "closed form", "scene without a folder"],
)
def test_nothing_heavy_is_loaded_without_need(command: list[str] | None, heavy: set[str]) -> None:
    program = (
        "import sys, tippedisk_verify.model.equations; from tippedisk_verify.cli import main\n"
        f"assert {command} is None or main({command}) == 0\n"
        f"assert not {heavy} & set(sys.modules), set(sys.modules)"
    )
    subprocess.run([sys.executable, "-c", program], capture_output=True, check=True)


def test_without_heyoka_its_users_give_one_line() -> None:
    """Check a platform without wheels of heyoka: closed forms are available there too."""
    program = (
        "import sys; sys.modules['heyoka'] = None; from tippedisk_verify.cli import main\n"
        "assert main(['hopf', '--quiet']) == 0\n"
        "sys.exit(main(['heteroclinic', '--quiet', '--method', 'bisection']))"
    )
    run = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=False
    )
    assert run.returncode == 1
    assert run.stderr.startswith(
        "tippedisk-verify: a library is missing, or there is no memory for it: heyoka"
    )
    assert "Linux" in run.stderr
    assert run.stderr.count("\n") == 1


def test_public_names_exist() -> None:
    for name in tv.__all__:
        assert getattr(tv, name) is not None
    assert set(tv.__all__) <= set(dir(tv))
    with pytest.raises(AttributeError):
        _ = tv.nothing  # type: ignore[attr-defined]


@pytest.mark.parametrize("name", ["", ".disk", ".model.measured", ".cycles.limit_cycle"])
def test_the_examples_of_docstrings_run(name: str) -> None:
    module = import_module(f"tippedisk_verify{name}")
    finder, runner = doctest.DocTestFinder(), doctest.DocTestRunner()
    classes = (
        item
        for item in vars(module).values()
        if isinstance(item, type) and item.__module__ == module.__name__
    )
    # None is found in a wrapper.
    methods = (inspect.unwrap(member) for kind in classes for member in vars(kind).values())
    for item in (module, *filter(inspect.isfunction, methods)):
        for test in finder.find(item, getattr(item, "__qualname__", None), module, vars(module)):
            runner.run(test)
    assert (runner.failures, runner.tries > 0) == (0, True)
