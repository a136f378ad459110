"""Many high-precision orbits in one process: what they take is given back.

Orbits with up to some thirty numbers in each array, that is (numpy keeps such small blocks for the next array). Each
element of a larger one keeps its digits when the array goes: some 50 bytes at 256 bits. heyoka's own memory handler is
there to prevent it, and has no effect in version 7.13.2 with numpy 2.2 or 2.4.
"""

from __future__ import annotations

import gc
from pathlib import Path

import pytest

from tippedisk_verify.flow.contract import Request, Status
from tippedisk_verify.flow.taylor import Taylor
from tippedisk_verify.model.parameters import PRINTED
from tippedisk_verify.model.precision import QUADRUPLE, Precision, bits

_STATUS = Path("/proc/self/status")
pytestmark = pytest.mark.skipif(not _STATUS.exists(), reason="needs /proc to see the memory")

_PAGES = 64 * 1024  # bytes: sixteen pages, which the allocator may take for itself at any moment


def _resident() -> int:
    gc.collect()
    line = next(line for line in _STATUS.read_text().splitlines() if line.startswith("VmRSS:"))
    return int(line.split()[1]) * 1024


def _fly(engine: Taylor, precision: Precision, count: int) -> None:
    for n in range(count):
        request = Request(
            PRINTED, "30.4", ("pi/2", f"2.{n % 10}", 0), "0.02", precision=precision, times=("0.01", "0.02")
        )
        assert engine(request).status is Status.REACHED


def _grown(engine: Taylor, precision: Precision, count: int) -> int:
    """Bytes that as many orbits again add to what the first ``count`` have taken."""
    _fly(engine, precision, count)
    before = _resident()
    _fly(engine, precision, count)
    return _resident() - before


def test_orbits_take_no_more(taylor: Taylor) -> None:
    assert _grown(taylor, bits(256), 40) <= _PAGES


@pytest.mark.slow
@pytest.mark.parametrize("precision", [QUADRUPLE, bits(256)], ids=lambda one: one.name)
def test_a_thousand_orbits_take_no_more(precision: Precision, capsys: pytest.CaptureFixture[str]) -> None:
    grown = _grown(Taylor(), precision, 1_000)
    with capsys.disabled():
        print(f"\n{precision.name}: a second 1000 orbits added {grown} bytes")
    assert grown <= _PAGES
