"""Where a result comes from: the code of this package, the packages that compute, and the processor.

A result that is kept is named by all of it. A change of any file of the package counts, so nobody has to know which
module needs which.
"""

from __future__ import annotations

import platform
from functools import lru_cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from tippedisk_verify.checksums import digest

__all__ = ["DRAWING", "NUMERICAL", "code_version", "key", "processor", "versions"]

#: The packages that numbers come from.
NUMERICAL = ("heyoka", "numpy", "mpmath", "gmpy2", "scipy", "python-flint")
#: And those that pictures come from.
DRAWING = (*NUMERICAL, "matplotlib")


@lru_cache(maxsize=1)
def code_version() -> str:
    """One line: this package's version with a hash of its code, and the numerical packages.

    Two processes with the same line may share their results. The processor is left out: half-widths hold on each. The
    answer is kept, because a process goes on with the code that it began with.
    """
    from tippedisk_verify import __version__

    root = Path(__file__).parent
    code = digest({path.relative_to(root).as_posix(): digest(path.read_bytes()) for path in root.rglob("*.py")})
    packages = ", ".join(f"{name} {number}" for name, number in versions(NUMERICAL).items())
    return f"tippedisk_verify {__version__} (code {code[:16]}), {packages}"


def key(inputs: dict[str, Any], packages: tuple[str, ...] = NUMERICAL) -> str:
    """64 hexadecimal digits that change with the inputs (as JSON), the code, these packages, Python and the processor.

    Compiled code uses what the processor has, and may round differently on another.
    """
    machine = (platform.python_version(), platform.system(), platform.machine(), processor())
    return digest({"inputs": inputs, "code": code_version(), "versions": versions(packages), "machine": machine})


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
def processor() -> str:
    """The processor's name, as well as the system tells it."""
    try:
        with open("/proc/cpuinfo", encoding="utf-8") as lines:
            return next(line.split(":", 1)[1].strip() for line in lines if line.startswith("model name"))
    except (OSError, StopIteration, UnicodeDecodeError):
        return platform.processor() or platform.machine()
