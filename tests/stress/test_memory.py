"""Many high-precision orbits in one process: what they take is given back.

heyoka does not free what the elements of its own arrays of MPFR numbers point to (its memory handler for numpy does
nothing in version 7.13), nor all of their continuous output, so the flow makes neither. Measured is what the C
library's allocator has handed out: the resident size hides some hundred bytes an orbit behind memory freed before.
"""

from __future__ import annotations

import ctypes
import gc
from collections.abc import Callable
from fractions import Fraction

import heyoka
import numpy
import pytest

from tippedisk_verify.cycles.shooting import limit_cycle
from tippedisk_verify.flow.contract import SECTION, Request, Status
from tippedisk_verify.flow.taylor import Taylor
from tippedisk_verify.model.parameters import PRINTED
from tippedisk_verify.model.precision import QUADRUPLE, Precision, bits

_LIBRARY = ctypes.CDLL(None)
pytestmark = pytest.mark.skipif(not hasattr(_LIBRARY, "mallinfo2"), reason="needs glibc to count its memory")

_SAMPLES = tuple(f"0.{n:03d}" for n in range(2, 21, 2))
_ASKED = {
    "bare": {},
    "ten samples": {"times": _SAMPLES},
    "samples, derivatives, divergence": {
        "times": _SAMPLES,
        "variations": ("beta", "gamma", "v", "Omega"),
        "divergence": True,
    },
    "continuous output": {"dense": True},
    "smooth law": {"times": _SAMPLES, "parameters": PRINTED.with_friction("smooth")},
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


def _flight(engine: Taylor, precision: Precision, asked: str) -> Callable[[], object]:
    wanted = {"parameters": PRINTED, "omega": "30.4", "state": ("pi/2", "2.1", 0), "duration": "0.02"} | _ASKED[asked]
    request = Request(**wanted, precision=precision)

    def run() -> None:
        assert engine(request).status is Status.REACHED

    return run


def test_arrays_of_these_numbers_are_what_to_avoid() -> None:
    """When this fails, the flow may make arrays again."""
    number = heyoka.real("0.3", 256)
    assert _grown(lambda: numpy.array([number] * 10), 100) >= 100 * 10 * 32


@pytest.mark.slow
@pytest.mark.parametrize("asked", _ASKED)
@pytest.mark.parametrize("precision", [QUADRUPLE, bits(256)], ids=lambda one: one.name)
def test_a_thousand_orbits_take_no_more(precision: Precision, asked: str) -> None:
    count = 1_000 if "samples" in asked else 200
    # Less than the smallest block there is, an orbit.
    assert _grown(_flight(Taylor(), precision, asked), count) <= 4 * count


@pytest.mark.slow
def test_limit_cycles_take_no_more(taylor: Taylor) -> None:
    """Each has some forty flights, with derivatives and events, at 230 and 294 bits."""
    grown = _grown(lambda: limit_cycle(PRINTED, Fraction("30.38"), taylor, digits=40), 10)
    assert grown <= 10 * 40 * 48
