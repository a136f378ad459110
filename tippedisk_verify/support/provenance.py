"""The origin of a result: the code, the packages that compute or draw, Python and the processor."""

from __future__ import annotations

import hashlib
import json
import platform
from contextlib import suppress
from functools import cache
from importlib import import_module
from pathlib import Path
from pkgutil import walk_packages

__all__ = [
    "DRAWING",
    "NUMERICAL",
    "code_version",
    "digest",
    "fingerprint",
    "origin",
    "processor",
    "versions",
]

_ROOT = Path(__file__).parents[1]  # the folder of the whole package
# The sub-packages that compute numbers.
_COMPUTING = (
    "numbers",
    "model",
    "theory",
    "flow",
    "connection",
    "cycles",
    "omega_h",
    "motion",
    "proofs",
    "reference_values",
    "sweep",
)
#: The packages on which numbers depend.
NUMERICAL = ("heyoka", "numpy", "mpmath", "gmpy2", "scipy", "python-flint")
#: The packages on which pictures depend.
DRAWING = (*NUMERICAL, "matplotlib")


def fingerprint(inputs: object, packages: tuple[str, ...] = NUMERICAL) -> str:
    """Return 64 hexadecimal digits that identify inputs together with the origin of their results.

    They change with the inputs, this package's code, the packages and the machine. The machine
    counts because compiled code uses its processor's features and may round differently on another.

    Args:
        inputs: The inputs, as JSON data.
        packages: The packages on which the result depends.
    """
    return digest([inputs, origin(packages)])


def origin(packages: tuple[str, ...] = NUMERICAL) -> dict[str, str]:
    """Return everything on which a result depends besides its inputs, by name.

    A cached result is valid only if its origin is the same.

    Args:
        packages: The packages on which the result depends.
    """
    machine = {
        "Python": platform.python_version(),
        "the machine": f"{platform.machine()} {processor()}",
    }
    return {"the code": _code(), **versions(packages), **machine, "the system": platform.system()}


@cache
def code_version() -> str:
    """Return the versions of this package, its code and the numerical packages, as text.

    The text holds a digest of the code. Two processes with the same text may share their results.
    The processor is left out because half-widths hold on every processor.

    All computing modules are imported at once and the answer is kept. So a process that has run for
    weeks still reports the code that it runs, even if other versions have been installed since.
    """
    code = _code()
    for package in _COMPUTING:
        folder = [str(_ROOT / package)]
        for module in walk_packages(folder, f"tippedisk_verify.{package}."):
            with suppress(ImportError):  # a module that lacks its packages computes nothing
                import_module(module.name)
    return ", ".join([code, *(f"{name} {number}" for name, number in versions(NUMERICAL).items())])


@cache
def _code() -> str:
    from tippedisk_verify import __version__

    files = {
        path.relative_to(_ROOT).as_posix(): digest(path.read_bytes())
        for path in _ROOT.rglob("*.py")
    }
    return f"tippedisk_verify {__version__} (code {digest(files)[:16]})"


@cache
def versions(packages: tuple[str, ...]) -> dict[str, str]:
    """Return the installed version of each package, or "not installed".

    Args:
        packages: The names of the packages.
    """
    from importlib.metadata import PackageNotFoundError, version  # 10 ms that most starts save

    found = dict.fromkeys(packages, "not installed")
    for package in packages:
        with suppress(PackageNotFoundError):
            found[package] = version(package)
    return found


@cache
def processor() -> str:
    """Return the processor's name as the operating system reports it."""
    try:
        with open("/proc/cpuinfo", encoding="utf-8") as lines:
            return next(
                line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")
            )
    except (OSError, StopIteration, UnicodeDecodeError):
        return platform.processor() or platform.machine()


def digest(content: object) -> str:
    """Return the SHA-256 of bytes or of JSON data, as 64 hexadecimal digits.

    The order of an object's keys does not matter.

    Args:
        content: Bytes or JSON data.
    """
    text = content if isinstance(content, bytes) else json.dumps(content, sort_keys=True).encode()
    return hashlib.sha256(text).hexdigest()
