"""The modules that importing loads, the public names, and the examples in docstrings."""

from __future__ import annotations

import doctest
import inspect
import re
import subprocess
import sys
from collections.abc import Iterator
from importlib import import_module
from typing import Any

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
        (["certify", "--help"], {"flint"}),
    ],
    ids=["import", "closed form", "scene without a folder", "help of proofs"],
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
        _ = tv.nothing


@pytest.mark.parametrize(
    "name",
    [
        *("", ".numbers.measured", ".cycles.monodromy"),
        pytest.param(".cycles.limit_cycle", marks=pytest.mark.slow(minutes=0.1)),
        pytest.param(".disk", marks=pytest.mark.slow(minutes=0.2)),
    ],
)
def test_the_examples_of_docstrings_run(name: str) -> None:
    module = import_module(f"tippedisk_verify{name}")
    finder, runner = doctest.DocTestFinder(), doctest.DocTestRunner()
    classes = (
        item
        for item in vars(module).values()
        if isinstance(item, type) and item.__module__ == module.__name__
    )
    # The finder looks neither into wrappers nor into cached properties.
    members = (member for kind in classes for member in vars(kind).values())
    methods = (inspect.unwrap(getattr(member, "func", member)) for member in members)
    found = {
        test.docstring: test  # once, though the finder may see a method in its class as well
        for item in (module, *filter(inspect.isfunction, methods))
        for test in finder.find(item, getattr(item, "__qualname__", None), module, vars(module))
    }
    for test in found.values():
        runner.run(test)
    assert (runner.failures, runner.tries > 0) == (0, True)


def public_functions() -> Iterator[tuple[str, Any]]:
    """Yield the public functions, and the public methods and properties of public classes."""
    for name in tv.__all__:
        item = getattr(tv, name)
        if inspect.isfunction(item):
            yield name, item
        members = vars(item).items() if inspect.isclass(item) else ()
        for label, member in members:
            function = getattr(member, "__func__", getattr(member, "fget", member))
            function = getattr(function, "func", function)  # of a cached property
            if inspect.isfunction(function) and not label.startswith("_"):
                yield f"{name}.{label}", function


@pytest.mark.parametrize(
    ("label", "function"), [pytest.param(*pair, id=pair[0]) for pair in public_functions()]
)
def test_a_docstring_describes_arguments_and_results(label: str, function: Any) -> None:
    """Every argument is in Args. A method with arguments returns something that is described."""
    text, signature = inspect.getdoc(function), inspect.signature(function)
    assert text, "there is no docstring"
    section = re.search(r"Args:\n(.*?)(\n\S|\Z)", text, re.DOTALL)
    described = section.group(1) if section else ""
    kinds = inspect.Parameter.VAR_KEYWORD, inspect.Parameter.VAR_POSITIONAL
    names = [
        name
        for name, parameter in signature.parameters.items()
        if name not in ("self", "cls") and parameter.kind not in kinds
    ]
    assert [name for name in names if not re.search(rf"\b{name}[,:]", described)] == []
    if names and signature.return_annotation not in (None, "None"):
        assert text.startswith(("Return", "Yield")) or "Returns:" in text
