"""What a search for Omega_h with round numbers ends at: an end of its interval, few bisections, a start too far off."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator

import numpy

from tippedisk_verify.conformance.diagnosis.alternatives import Alternative
from tippedisk_verify.conformance.diagnosis.flights import RK4, Array, Field, field
from tippedisk_verify.conformance.diagnosis.predictions import Model

__all__ = ["searches"]

_QUARTER = math.pi / 2
_END = 1e-6  # rad/s; how far a search may leave its interval's end
_DECIMALS = 2  # of such an end
_HALVINGS = range(3, 13)  # of an interval whose ends have one decimal; more are hardly few
_DYADIC = 1e-9  # rad/s
_CLOSE = 0.05  # relative: a start on the manifold moves it by less
_WITHIN = 3e-4  # of the error of Omega_h: as near as a start must give it
_LEAST = 2e-8  # rad/s; what these flights leave of it
_H, _LONGEST = 1e-3, 6.0  # s
_PAST = 0.1  # rad: beyond the other saddle
_BACK = 0.05  # rad
_SIZES = [m * 10.0**-k for k in range(3) for m in (1, 2, 3, 5)]


def searches(set_name: str, friction: str, given: float, right: float) -> Iterator[str]:
    """What was done, if it gives this speed."""
    for n in range(_DECIMALS + 1):
        if abs(round(given, n) - given) < _END:
            if round(right, n) == round(given, n):
                yield f"omega_h is rounded to {n} decimals, or such a number is typed in: {round(given, n):g}"
            else:
                yield (
                    f"omega_h is the round number {round(given, n):g}, typed in or an end of the interval searched, as "
                    "where it does not hold the root, orbits end too early to tell, or the wrong half is kept"
                )
            return
    for n in _HALVINGS:
        unit = 0.1 / 2**n
        if abs(round(given / unit) * unit - given) < _DYADIC and abs(given - right) < 10 * unit:
            yield f"omega_h is a multiple of 0.1/2^{n}: a bisection that stops after few steps"
            return
    if abs(given / right - 1) < _CLOSE:
        yield from _departures(set_name, friction, given, right)


def _departures(set_name: str, friction: str, given: float, right: float) -> Iterator[str]:
    """Starts so far from the saddle, along its unstable eigenvector or another direction, that lead to this speed."""
    model = Model(Alternative("", ""), set_name, friction)
    matrix = numpy.array([[0.0, 0.0, 1.0], *model.jacobian(given, (_QUARTER, -_QUARTER, 0.0))])
    values, vectors = numpy.linalg.eig(matrix)
    away = vectors[:, int(numpy.argmax(values.real))].real
    away = away / numpy.linalg.norm(away) * math.copysign(1.0, away[0])
    named = {"from the saddle along the unstable eigenvector": away}
    for place, name in enumerate(("beta", "gamma", "v")):
        named[f"in {name} from the saddle along the unstable eigenvector"] = away / away[place]
        named[f"from the saddle in {name} alone"] = numpy.eye(3)[place]
    starts = list(itertools.product(named.items(), _SIZES))
    within = max(_LEAST, _WITHIN * abs(given - right))
    start = numpy.array([size * vector for (_, vector), size in starts for _ in range(2)]).T
    speeds = given + within * numpy.tile([-1.0, 1.0], len(starts))
    sides = _sides(field(set_name, friction, speeds), start + numpy.array([[_QUARTER], [-_QUARTER], [0.0]]))
    for ((name, _), size), below, above in zip(starts, sides[::2], sides[1::2], strict=True):
        if (below, above) == (1, -1):
            yield f"the search for Omega_h starts too far away: {size:g} {name}"


def _sides(f: Field, y: Array) -> Array:
    """1 for orbits that pass the other saddle, -1 for those that turn back before, 0 for neither."""
    sides = numpy.zeros(y.shape[1])
    with numpy.errstate(all="ignore"):
        for _ in range(round(_LONGEST / _H)):
            y = RK4(f, y, _H)
            sides[(sides == 0) & (y[0] < _QUARTER - _BACK)] = -1
            sides[(sides == 0) & (y[1] > 3 * _QUARTER + _PAST)] = 1
            if sides.all():
                break
    return sides
