"""What a command costs from the shell: Python, imports, compiling with an empty and with a filled code cache."""

from __future__ import annotations

import os
import shutil
import statistics
import subprocess
import sys
import tempfile
import time
from dataclasses import asdict, dataclass
from functools import partial
from typing import Any

from tippedisk_verify.cache import VARIABLE
from tippedisk_verify.interrupts import deaf_children, undoing

__all__ = ["StartUp", "start_up"]

_IMPORTS = "import heyoka, numpy, mpmath, gmpy2, click, tippedisk_verify.orbits.continuation"
_BUILDS = _IMPORTS + "; from tippedisk_verify.bench.bare_builds import build; build()"
_ORBIT = ["-m", "tippedisk_verify", "orbit", "--below-crit", "0.5", "--quiet"]


@dataclass(frozen=True)
class StartUp:
    """Seconds from the shell, medians."""

    python: float  #: ``python -c pass``
    imports: float  #: with the imports that `orbit` needs
    bare_builds_cold: float  #: imports and heyoka's own builds, empty code cache
    orbit_cold: float  #: ``orbit --below-crit 0.5``, empty code cache
    orbit_cached: float  #: the same, filled code cache

    def json(self) -> dict[str, Any]:
        return asdict(self) | {"orbit_cold_over_bare": self.orbit_cold / self.bare_builds_cold}


def start_up(repeats: int = 3) -> StartUp:
    """Measured in fresh processes, each cold one with a code cache of its own."""

    def seconds(arguments: list[str], cache: str) -> float:
        environment = {**os.environ, "XDG_CACHE_HOME": cache, VARIABLE: "code"}
        begin = time.perf_counter()
        with deaf_children():
            run = subprocess.Popen([sys.executable, *arguments], env=environment, stdout=subprocess.DEVNULL)
        with undoing(run.kill):
            if run.wait():
                raise subprocess.CalledProcessError(run.returncode, run.args)
        return time.perf_counter() - begin

    times: dict[str, list[float]] = {name: [] for name in StartUp.__dataclass_fields__}
    for _ in range(repeats):
        with tempfile.TemporaryDirectory() as both, undoing(partial(shutil.rmtree, both, ignore_errors=True)):
            first, second = f"{both}/first", f"{both}/second"
            times["python"].append(seconds(["-c", "pass"], first))
            times["imports"].append(seconds(["-c", _IMPORTS], first))
            times["bare_builds_cold"].append(seconds(["-c", _BUILDS], first))
            times["orbit_cold"].append(seconds(_ORBIT, second))
            times["orbit_cached"].append(seconds(_ORBIT, second))
    return StartUp(**{name: statistics.median(values) for name, values in times.items()})
