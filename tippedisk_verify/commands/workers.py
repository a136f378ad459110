"""The processes of a pool: started whole, deaf to Ctrl-C and HUP, and gone when their parent is gone."""

from __future__ import annotations

import os
import threading
from multiprocessing import active_children, parent_process
from multiprocessing.context import SpawnContext, SpawnProcess

from tippedisk_verify.interrupts import deaf_children, unbroken

__all__ = ["Workers", "end_with_parent", "kill_workers", "quiet_tracker"]

_QUIET = "ignore::UserWarning:multiprocessing.resource_tracker"


class Worker(SpawnProcess):
    """A fresh process: what its parent has compiled, and its parent's threads, are not for forking."""

    def start(self) -> None:
        # A process whose orders break off prints a traceback.
        with unbroken(), deaf_children():
            super().start()


class Workers(SpawnContext):
    """What a ProcessPoolExecutor takes as its ``mp_context``."""

    Process = Worker


def quiet_tracker() -> None:
    """Let Python's resource tracker remove without a word the semaphores that an interrupted pool leaves."""
    others = os.environ.get("PYTHONWARNINGS", "")
    if _QUIET not in others:
        os.environ["PYTHONWARNINGS"] = f"{others},{_QUIET}" if others else _QUIET


def kill_workers() -> None:
    """End every process that this one has started through multiprocessing."""
    for worker in active_children():
        worker.kill()


def end_with_parent() -> None:
    """In a worker: leave when the process that started it is gone, even if it was killed."""
    parent = parent_process()
    if parent is None:
        return

    def watch() -> None:
        parent.join()
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()
