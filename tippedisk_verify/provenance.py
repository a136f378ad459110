"""Where a result comes from: this package's code, the packages that compute or draw, Python, and the processor."""

from __future__ import annotations

import hashlib
import json
import platform
from contextlib import suppress
from functools import cache
from importlib import import_module
from pathlib import Path
from pkgutil import iter_modules

__all__ = ["DRAWING", "NUMERICAL", "code_version", "digest", "fingerprint", "origin", "processor", "versions"]

_ROOT = Path(__file__).parent
_COMPUTING = (
    "model",
    "theory",
    "flow",
    "connection",
    "cycles",
    "motion",
    "proofs",
    "reference_values",
    "sweep",
)
#: The packages that numbers come from.
NUMERICAL = ("heyoka", "numpy", "mpmath", "gmpy2", "scipy", "python-flint")
#: And those that pictures come from.
DRAWING = (*NUMERICAL, "matplotlib")


def fingerprint(inputs: object, packages: tuple[str, ...] = NUMERICAL) -> str:
    """64 hexadecimal digits that change with the inputs (as JSON), this package's code, those packages and the machine.

    Compiled code uses what the processor has, and may round differently on another.
    """
    return digest([inputs, origin(packages)])


def origin(packages: tuple[str, ...] = NUMERICAL) -> dict[str, str]:
    """All that a result depends on beside its inputs, by name: what a result that is kept must agree with."""
    machine = {"Python": platform.python_version(), "the machine": f"{platform.machine()} {processor()}"}
    return {"the code": _code(), **versions(packages), **machine, "the system": platform.system()}


@cache
def code_version() -> str:
    """This package's version, a digest of its code, and the versions of the numerical packages, as words of a message.

    Two processes with the same one may share their results; the processor is left out, because half-widths hold on
    each. What computes is loaded at once and the answer kept: a process that has run for weeks goes on saying which
    code it runs, whatever has been installed meanwhile.
    """
    code = _code()
    for package in _COMPUTING:
        for module in iter_modules([str(_ROOT / package)], f"tippedisk_verify.{package}."):
            with suppress(ImportError):  # what needs a package that is not there computes nothing
                import_module(module.name)
    return ", ".join([code, *(f"{name} {number}" for name, number in versions(NUMERICAL).items())])


@cache
def _code() -> str:
    from tippedisk_verify import __version__

    files = {path.relative_to(_ROOT).as_posix(): digest(path.read_bytes()) for path in _ROOT.rglob("*.py")}
    return f"tippedisk_verify {__version__} (code {digest(files)[:16]})"


@cache
def versions(packages: tuple[str, ...]) -> dict[str, str]:
    """The installed version of each package."""
    from importlib.metadata import PackageNotFoundError, version  # ten milliseconds that most starts need not spend

    found = dict.fromkeys(packages, "not installed")
    for package in packages:
        with suppress(PackageNotFoundError):
            found[package] = version(package)
    return found


@cache
def processor() -> str:
    """The processor's name, as well as the system tells it."""
    try:
        with open("/proc/cpuinfo", encoding="utf-8") as lines:
            return next(line.split(":", 1)[1].strip() for line in lines if line.startswith("model name"))
    except (OSError, StopIteration, UnicodeDecodeError):
        return platform.processor() or platform.machine()


def digest(content: object) -> str:
    """The SHA-256 of bytes, or of anything that JSON can hold whatever the order of its keys: 64 hexadecimal digits."""
    text = content if isinstance(content, bytes) else json.dumps(content, sort_keys=True).encode()
    return hashlib.sha256(text).hexdigest()
