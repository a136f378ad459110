"""What compiled integrators need to be safe: one run at a time, whichever thread it comes from.

heyoka's integrators hold the state of their run and let other threads go on meanwhile. Two runs of one integrator would
mix their states, and nothing would show it.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from threading import RLock
from typing import Any

from tippedisk_verify.model.code_cache import vouched

__all__ = ["OneAtATime", "building"]

_BUILDING = RLock()


@contextmanager
def building() -> Iterator[None]:
    """Entered while something is compiled, by one thread at a time.

    Who needs the same in another thread then finds its machine code in memory, and what was compiled gets its checksum
    before anything can happen to it.
    """
    with _BUILDING:
        yield
        vouched()


class OneAtATime:
    """Something with a method ``run`` whose calls wait for each other."""

    def __init__(self, runner: Any) -> None:
        self.runner = runner
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
            try:
                return self.runner.run(*arguments)
            finally:
                self._running = False
