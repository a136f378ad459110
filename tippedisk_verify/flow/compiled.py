"""What compiled integrators need to be safe and few: one run at a time, whichever thread it comes from.

heyoka's integrators hold the state of their run and let other threads go on meanwhile. Two runs of one integrator would
mix their states, and nothing would show it.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import count
from threading import RLock
from typing import Any

from tippedisk_verify.model.code_cache import vouch

__all__ = ["CompiledRunners"]

#: Integrators that an engine keeps, each of 1 to 4 MB; all commands one after the other need some 40, `stress` 110.
_MOST_KEPT = 128
_COMPILING = RLock()
_CLOCK = count()


class CompiledRunners:
    """What an engine has compiled, each with a method ``run``. Copies of the engine begin with nothing."""

    def __init__(self) -> None:
        self._slots: dict[Any, _Slot] = {}

    def __reduce__(self) -> tuple[Any, ...]:
        return CompiledRunners, ()

    def kept(self) -> list[Any]:
        """Everything that is still kept, in the order in which it was compiled."""
        return [slot.runner for slot in list(self._slots.values())]

    def run(self, key: object, compiled: Callable[[], Any], *arguments: Any) -> Any:
        """What the ``run`` of the runner for ``key`` returns; ``compiled`` makes the runner if none is kept.

        One thread at a time compiles: another one that needs the same finds its machine code in memory. Raises
        RuntimeError for a call from within a run of the same runner, which cannot wait. Only an event function that
        asks the engine it is computed by can make one.
        """
        slot = self._slots.get(key)
        if slot is None:
            with _COMPILING:
                slot = self._slots.get(key)
                if slot is None:  # another thread may have been faster
                    while len(self._slots) >= _MOST_KEPT:  # what has not run for longest leaves
                        del self._slots[min(self._slots, key=lambda other: self._slots[other].used)]
                    slot = self._slots[key] = _Slot(compiled())
                vouch()  # what was compiled gets its checksum before anything can happen to it
        with slot.lock:
            if slot.running:
                raise RuntimeError("a run asks for another one of the same kind: take another engine for it")
            slot.running, slot.used = True, next(_CLOCK)
            try:
                return slot.runner.run(*arguments)
            finally:
                slot.running = False


class _Slot:
    """A runner and whether it is on a run."""

    def __init__(self, runner: Any) -> None:
        self.runner, self.lock, self.running = runner, RLock(), False
        self.used = next(_CLOCK)  #: grows from run to run, of whatever runner
