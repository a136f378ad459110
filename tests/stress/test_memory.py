"""Many high-precision orbits in one process return the memory that they take.

heyoka does not free the numbers in its own arrays of MPFR numbers (its memory handler for numpy
does nothing in version 7.13), nor all of their continuous output, so the flow uses neither. The
test measures what the C library's allocator has handed out. The resident size would hide some
hundred bytes an orbit behind memory freed before.
"""

from __future__ import annotations

import ctypes
import gc

import pytest

from tippedisk_verify import PRINTED, Request, Status, Taylor, precision_of_bits
from tippedisk_verify.flow.contract import SECTION

_LIBRARY = ctypes.CDLL(None)
pytestmark = pytest.mark.skipif(
    not hasattr(_LIBRARY, "mallinfo2"), reason="needs glibc to count its memory"
)

_SAMPLES = tuple(f"0.{n:03d}" for n in range(2, 21, 2))
_ORBITS = 50  # of a batch
# What is lost in every orbit shows in every batch: the smallest block, 32 bytes, as 1600. What only
# settles (caches, and the allocator's blocks, some 16 bytes larger or smaller than before) took up
# to 3000 bytes in each of the first six batches, and between -400 and 900 in the next six.
_BATCHES = 16
_ASKED = {
    "samples and derivatives": {
        "times": _SAMPLES,
        "variations": ("beta", "gamma", "v", "Omega"),
        "divergence": True,
    },
    "continuous output": {"dense": True},
    "events and error": {"events": (SECTION,), "domain": "event", "error_estimate": True},
}


class _Mallinfo(ctypes.Structure):
    # Hblkhd is the fifth, of large blocks, and uordblks the eighth
    _fields_ = [("of", ctypes.c_size_t * 10)]


def _taken() -> int:
    # What a finalizer lets go of, a figure's for instance, is found the next time only
    while gc.collect():
        pass
    _LIBRARY.mallinfo2.restype = _Mallinfo
    found = _LIBRARY.mallinfo2().of
    return int(found[4] + found[7])


@pytest.mark.slow(minutes=1)
@pytest.mark.parametrize("asked", _ASKED)
def test_orbits_take_no_more(asked: str) -> None:
    engine = Taylor()
    wanted = {
        "parameters": PRINTED,
        "omega": "30.4",
        "state": ("pi/2", "2.1", 0),
        "duration": "0.02",
    } | _ASKED[asked]
    request = Request(**wanted, precision=precision_of_bits(256))

    def run() -> None:
        assert engine(request).status is Status.REACHED

    batches = []
    for _ in range(_BATCHES):
        before = _taken()
        for _ in range(_ORBITS):
            run()
        batches.append(_taken() - before)
        if batches[-1] <= 4 * _ORBITS:  # less than the smallest block there is, an orbit
            return
    pytest.fail(f"every batch of {_ORBITS} orbits took bytes: {batches}")
