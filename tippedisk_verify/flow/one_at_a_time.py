"""What compiled integrators need to be safe and few: one run at a time, whichever thread it comes from.

heyoka's integrators hold the state of their run and let other threads go on meanwhile. Two runs of one integrator would
mix their states, and nothing would show it.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from itertools import count
from threading import RLock
from typing import Any

from tippedisk_verify.model.code_cache import vouch

__all__ = ["Kept", "OneAtATime", "building"]

#: Integrators that an engine keeps, each of 1 to 4 MB; all commands one after the other need some 40, `stress` 110.
_MOST_KEPT = 128
_BUILDING = RLock()
_CLOCK = count()


@contextmanager
def building() -> Iterator[None]:
    """Entered while something is compiled, by one thread at a time.

    Another thread that needs the same then finds its machine code in memory, and what was compiled gets its checksum
    before anything can happen to it.
    """
    with _BUILDING:
        yield
        vouch()


class Kept(dict[Any, "OneAtATime"]):
    """What an engine has compiled. It stays here: copies of the engine, and other processes, begin with nothing."""

    def __reduce__(self) -> tuple[Any, ...]:
        return Kept, ()

    def make_room(self) -> None:
        """For one more; what has not run for longest leaves. To be called within `building`."""
        while len(self) >= _MOST_KEPT:
            del self[min(self, key=lambda key: self[key].used)]


class OneAtATime:
    """Something with a method ``run`` whose calls wait for each other."""

    def __init__(self, runner: Any) -> None:
        self.runner = runner
        self.used = next(_CLOCK)  #: grows from run to run, of whatever runner
        self._lock = RLock()
        self._running = False

    def run(self, *arguments: Any) -> Any:
        """What the runner's ``run`` returns. Raises RuntimeError for a call from within another one, which cannot wait.

        That can only come from an event function that asks the engine it is computed by.
        """
        with self._lock:
            if self._running:
                raise RuntimeError("a run asks for another one of the same kind: take another engine for it")
            self._running = True
            self.used = next(_CLOCK)
            try:
                return self.runner.run(*arguments)
            finally:
                self._running = False
