"""A store of compiled integrators that limits their number and lets each do one run at a time.

heyoka's integrators hold the state of their run, and other threads continue during the run. Two
simultaneous runs of one integrator would mix their states without any sign of it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from itertools import count
from threading import RLock
from typing import Any

from tippedisk_verify.flow.code_cache import add_checksums

__all__ = ["CompiledRunners"]

# The number of integrators that an engine keeps, each of 1 to 4 MB. All commands in turn need
# about 40, and `stress` needs 110.
_MAX_KEPT = 128
_COMPILE_LOCK = RLock()
_RUN_COUNTER = count()


class CompiledRunners:
    """The compiled integrators (runners) that an engine keeps, each with a method ``run``. A
    pickled copy is empty.
    """

    def __init__(self) -> None:
        self._slots: dict[Any, _Slot] = {}

    def __reduce__(self) -> tuple[Any, ...]:
        return CompiledRunners, ()

    def kept(self) -> list[Any]:
        """Return all compiled integrators that are still kept, in the order of their
        compilation.
        """
        return [slot.runner for slot in list(self._slots.values())]

    @contextmanager
    def reserved(self, key: object, compiled: Callable[[], Any]) -> Iterator[Any]:
        """Yield the runner of a key for one run, compiling it first if necessary.

        One thread compiles at a time. Another thread that needs the same runner then finds it
        compiled. It waits until the runner is free.

        Args:
            key: The key of the runner.
            compiled: A function that compiles and returns the runner.

        Raises:
            RuntimeError: If the call comes from within a run of the same runner, which cannot wait.
                Only an event function that calls its own engine can cause this.
        """
        slot = self._slots.get(key)
        if slot is None:
            with _COMPILE_LOCK:
                slot = self._slots.get(key)
                if slot is None:  # another thread may have been faster
                    while len(self._slots) >= _MAX_KEPT:  # remove the least recently used runner
                        del self._slots[min(self._slots, key=lambda other: self._slots[other].used)]
                    slot = self._slots[key] = _Slot(compiled())
                add_checksums()  # add the checksum of the new code at once
        with slot.lock:
            if slot.running:
                raise RuntimeError(
                    "a run has started another run of the same kind: use a second engine for that"
                )
            slot.running, slot.used = True, next(_RUN_COUNTER)
            try:
                yield slot.runner
            finally:
                slot.running = False


class _Slot:
    """A compiled integrator with its lock and the number of its last run, which shows which one was
    used least recently.
    """

    def __init__(self, runner: Any) -> None:
        self.runner, self.lock, self.running = runner, RLock(), False
        self.used = next(_RUN_COUNTER)  #: the number of its last run, counted over all runners
