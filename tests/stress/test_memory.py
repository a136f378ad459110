"""Many high-precision orbits in one process: what they take is given back.

heyoka does not free what the elements of its own arrays of MPFR numbers point to (its memory handler for numpy does
nothing in version 7.13), nor all of their continuous output, so the flow makes neither. Measured is what the C
library's allocator has handed out: the resident size hides some hundred bytes an orbit behind memory freed before.
"""

from __future__ import annotations

import ctypes
import gc
from collections.abc import Callable

import pytest

from tippedisk_verify.flow.contract import SECTION, Request, Status
from tippedisk_verify.flow.taylor import Taylor
from tippedisk_verify.model.parameters import PRINTED
from tippedisk_verify.model.precision import bits

_LIBRARY = ctypes.CDLL(None)
pytestmark = pytest.mark.skipif(not hasattr(_LIBRARY, "mallinfo2"), reason="needs glibc to count its memory")

_SAMPLES = tuple(f"0.{n:03d}" for n in range(2, 21, 2))
_ASKED = {
    "samples and derivatives": {"times": _SAMPLES, "variations": ("beta", "gamma", "v", "Omega"), "divergence": True},
    "continuous output": {"dense": True},
    "events and error": {"events": (SECTION,), "domain": "event", "error_estimate": True},
}


class _Mallinfo(ctypes.Structure):
    _before = ("arena", "ordblks", "smblks", "hblks")
    _after = ("usmblks", "fsmblks", "uordblks", "fordblks", "keepcost")
    _fields_ = [(name, ctypes.c_size_t) for name in (*_before, "hblkhd", *_after)]


def _taken() -> int:
    while gc.collect():  # what a finalizer lets go of, a figure's for instance, is found the next time only
        pass
    _LIBRARY.mallinfo2.restype = _Mallinfo
    found = _LIBRARY.mallinfo2()
    return int(found.uordblks + found.hblkhd)


def _grown(run: Callable[[], object], count: int) -> int:
    """Bytes that as many runs again take for good, after the first ``count``: the least of three such batches.

    What is lost in every run shows in each of them; the allocator's and compilers' own pools settle after some hundred.
    """
    for _ in range(count):
        run()
    batches = []
    for _ in range(3):
        before = _taken()
        for _ in range(count):
            run()
        batches.append(_taken() - before)
    return min(batches)


@pytest.mark.slow
@pytest.mark.parametrize("asked", _ASKED)
def test_orbits_take_no_more(asked: str) -> None:
    engine = Taylor()
    wanted = {"parameters": PRINTED, "omega": "30.4", "state": ("pi/2", "2.1", 0), "duration": "0.02"} | _ASKED[asked]
    request = Request(**wanted, precision=bits(256))

    def run() -> None:
        assert engine(request).status is Status.REACHED

    # Less than the smallest block there is, an orbit.
    assert _grown(run, 200) <= 4 * 200
