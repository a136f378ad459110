"""A Dask scheduler and workers as separate processes, with this package or a changed one."""

from __future__ import annotations

import asyncio
import json
import os
import shutil
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import tippedisk_verify

PACKAGE = Path(tippedisk_verify.__file__).parent
_LONGEST = 120  # s; a process that is not ready by then hangs


def changed_package(folder: Path, module: str, old: str, new: str) -> Path:
    """Make a folder for PYTHONPATH with which one module has other code."""
    shutil.copytree(
        PACKAGE, folder / "tippedisk_verify", ignore=shutil.ignore_patterns("__pycache__")
    )
    path = folder / "tippedisk_verify" / module
    text = path.read_text()
    assert text.count(old) == 1
    path.write_text(text.replace(old, new))
    return folder


def surroundings(path: Path | None) -> dict[str, str]:
    return {
        **os.environ,
        "OPENBLAS_NUM_THREADS": "1",
        **({} if path is None else {"PYTHONPATH": str(path)}),
    }


@contextmanager
def scheduler(folder: Path) -> Iterator[tuple[subprocess.Popen[bytes], str]]:
    """Start a scheduler on a free port of this machine; yield the process and HOST:PORT."""
    file = folder / "scheduler.json"
    options = ["--port", "0", "--no-dashboard", "--scheduler-file", str(file)]
    with _process("dask_scheduler", options, folder) as process:
        _until(lambda: file.exists() and file.read_text())
        yield process, json.loads(file.read_text())["address"].removeprefix("tcp://")


@contextmanager
def worker(
    host: str, folder: Path, path: Path | None = None, threads: int = 1
) -> Iterator[subprocess.Popen[bytes]]:
    """Start a worker in one process, and wait until the scheduler knows it."""
    before = len(workers(host))
    options = [f"tcp://{host}", "--no-nanny", "--no-dashboard", "--nthreads", str(threads)]
    with _process("dask_worker", options, folder, path) as process:
        _until(lambda: len(workers(host)) > before)
        yield process


def workers(host: str) -> list[str]:
    """Return HOST:PORT of each worker that the scheduler knows."""
    from distributed import rpc

    async def asked() -> list[str]:
        async with rpc(f"tcp://{host}") as one:
            return [address.removeprefix("tcp://") for address in await one.ncores()]

    return asyncio.run(asked())


@contextmanager
def _process(
    name: str, options: list[str], folder: Path, path: Path | None = None
) -> Iterator[subprocess.Popen[bytes]]:
    command = [sys.executable, "-m", f"distributed.cli.{name}", "--host", "127.0.0.1", *options]
    with open(folder / f"{name}.log", "ab") as log:
        process = subprocess.Popen(
            command, stdout=log, stderr=log, env=surroundings(path), cwd=folder
        )
    try:
        yield process
    finally:
        process.kill()
        process.wait()


def _until(true: Callable[[], object]) -> None:
    begin = time.monotonic()
    while not true():
        assert time.monotonic() - begin < _LONGEST
        time.sleep(0.05)
