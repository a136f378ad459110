"""What a result depends on, as one number: code, inputs, and the packages that compute.

The code is the module that makes the result and every module of this package that it imports, directly or not, also
inside functions. It is read as text, so nothing is imported to find out.
"""

from __future__ import annotations

import ast
import platform
from collections.abc import Iterator, Mapping
from functools import lru_cache
from importlib import import_module
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from tippedisk_verify.checksums import digest

__all__ = ["DRAWING", "NUMERICAL", "closure", "fingerprint", "origin", "processor", "unlike", "versions"]

_PACKAGE = "tippedisk_verify"
_ROOT = Path(__file__).parent
#: The packages that numbers come from.
NUMERICAL = ("heyoka", "numpy", "mpmath", "gmpy2", "scipy")
#: And those that pictures come from.
DRAWING = (*NUMERICAL, "matplotlib")


def fingerprint(module: str, inputs: dict[str, Any], packages: tuple[str, ...] = NUMERICAL) -> str:
    """64 hexadecimal digits that change with the module's code, the inputs (as JSON), packages, or processor."""
    code = {name: _content(name) for name in closure(module)}
    parts = {"code": code, "inputs": inputs, "versions": versions(packages), "machine": _machine()}
    return digest(parts)


@lru_cache(maxsize=8)
def origin(module: str) -> dict[str, str]:
    """Where the module's numbers come from: this package's version, a hash of the code, and the numerical packages.

    Two processes with the same origin may share their results; the processor is left out, because half-widths hold on
    each. What has been read is loaded at once and the answer kept: a process that has run for weeks goes on saying
    which code it runs, whatever has been installed meanwhile.
    """
    from tippedisk_verify import __version__

    content = {name: _content(name) for name in closure(module)}
    for name in content:
        import_module(name)
    return {_PACKAGE: __version__, "code": digest(content)[:16], **versions(NUMERICAL)}


def unlike(other: Mapping[str, object], mine: Mapping[str, str]) -> str:
    """What differs in another `origin`, in words for a message; empty if nothing does."""
    different = [
        f"{name} {str(other.get(name, 'unknown'))[:40]} instead of {text}"
        for name, text in mine.items()
        if name != "code" and other.get(name) != text
    ]
    if not different and other.get("code") != mine["code"]:
        different = [f"changed code of {_PACKAGE} {mine[_PACKAGE]}"]
    return ", ".join(different)


def closure(module: str) -> tuple[str, ...]:
    """The module, what it lies in, and all of this package that they import, directly or not, in alphabetical order.

    The package's own ``__init__`` is left out: it only forwards names, and would tie everything to everything.
    """
    seen: set[str] = set()
    parts = module.split(".")
    ahead = [".".join(parts[:n]) for n in range(2, len(parts) + 1)]
    while ahead:
        name = ahead.pop()
        if name not in seen and name != _PACKAGE:
            seen.add(name)
            ahead += _imports(name)
    return tuple(sorted(seen))


def versions(packages: tuple[str, ...]) -> dict[str, str]:
    """The installed version of each package."""
    return {package: _installed(package) for package in packages}


@lru_cache(maxsize=64)
def _installed(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:
        return "not installed"


@lru_cache(maxsize=1)
def _machine() -> tuple[str, ...]:
    """Compiled code uses what the processor has, and may round differently on another."""
    return (platform.python_version(), platform.system(), platform.machine(), processor())


@lru_cache(maxsize=1)
def processor() -> str:
    """The processor's name, as well as the system tells it."""
    try:
        with open("/proc/cpuinfo", encoding="utf-8") as lines:
            return next(line.split(":", 1)[1].strip() for line in lines if line.startswith("model name"))
    except (OSError, StopIteration, UnicodeDecodeError):
        return platform.processor() or platform.machine()


def _path(module: str) -> Path | None:
    place = _ROOT.joinpath(*module.split(".")[1:])
    if (place / "__init__.py").is_file():
        return place / "__init__.py"
    return place.with_suffix(".py") if place.with_suffix(".py").is_file() else None


@lru_cache(maxsize=512)
def _text(module: str) -> bytes:
    path = _path(module)
    return b"" if path is None else path.read_bytes()


@lru_cache(maxsize=512)
def _content(module: str) -> str:
    return digest(_text(module))


@lru_cache(maxsize=512)
def _imports(module: str) -> tuple[str, ...]:
    """Modules of this package that the module imports, with the packages that they lie in."""
    path = _path(module)
    if path is None:
        return ()
    package = module if path.name == "__init__.py" else module.rpartition(".")[0]
    modules: set[str] = set()
    for name in _named(ast.parse(_text(module)), package):
        parts = name.split(".")
        if parts[0] == _PACKAGE:
            modules.update(".".join(parts[:n]) for n in range(2, len(parts) + 1))
    return tuple(name for name in sorted(modules) if _path(name) is not None)


def _named(tree: ast.AST, package: str) -> Iterator[str]:
    """Full names in import statements; those for type checkers only are no dependence."""
    for node in ast.iter_child_nodes(tree):
        if isinstance(node, ast.If) and isinstance(node.test, ast.Name) and node.test.id == "TYPE_CHECKING":
            for other in node.orelse:
                yield from _named(other, package)
        elif isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            base = node.module or ""
            if node.level:
                above = package.split(".")[: len(package.split(".")) - node.level + 1]
                base = ".".join([*above, *([base] if base else [])])
            yield base
            yield from (f"{base}.{alias.name}" for alias in node.names)  # a name may be a module
        else:
            yield from _named(node, package)
