"""What a search for Omega_h ends at, by round numbers: its interval, bisections, start, duration, method, parameters.

Where none of these gives the answer, the text says what orbits from the saddle do at that speed.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator
from typing import Any

import numpy

from tippedisk_verify.conformance.diagnosis.alternatives import Alternative
from tippedisk_verify.conformance.diagnosis.flights import RK4, Array, Field, Step, field, runge_kutta
from tippedisk_verify.conformance.diagnosis.predictions import Model
from tippedisk_verify.reference_values.store import stored

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
_NEAR = 1e-5  # rad: a start that is on the manifold to 1e-10
_EXACT = 1e-5  # of the error of Omega_h: as near as another number or method must give it
_USUAL = (9.80665, 9.8067, 9.807)  # m/s^2
_LINEAR = 0.15  # of a change of a parameter; slopes foretell it that well
_SHORT, _TIME = 0.01, 1e-6  # s: durations are multiples of this, as near as a program at tolerance 1e-13 leaves them
_LATE = 1e-3  # rad/s: too short an orbit leaves more
_BEYOND = (0.0, 0.01, 0.02, 0.05, 0.1, 0.2)  # rad, of an orbit that has turned back
_FROM = [10.0**-k for k in range(3, 9)]
_METHODS = {
    "Euler's method": runge_kutta(((1.0,),)), "Heun's method": runge_kutta(((1.0,), (0.5, 0.5))),
    "the midpoint method": runge_kutta(((0.5,), (0.0, 1.0))), "the classical Runge-Kutta method": RK4,
}  # fmt: skip
_LENGTHS = (0.02, 0.01, 5e-3, 2e-3, 1e-3)  # s
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
        found = list(_departures(set_name, friction, given, right))
        found = found or list(_durations(set_name, friction, given, right))
        found = found or list(_numbers(set_name, friction, given, right))
        yield from (
            found or list(_steps(set_name, friction, given, right)) or [_observed(set_name, friction, given, right)]
        )


def _leaving(set_name: str, friction: str, speed: float) -> Array:
    """The unstable eigenvector at the noninverted state, of length 1, towards larger beta."""
    model = Model(Alternative("", ""), set_name, friction)
    matrix = numpy.array([[0.0, 0.0, 1.0], *model.jacobian(speed, (_QUARTER, -_QUARTER, 0.0))])
    values, vectors = numpy.linalg.eig(matrix)
    away = vectors[:, int(numpy.argmax(values.real))].real
    return numpy.asarray(away / numpy.linalg.norm(away) * math.copysign(1.0, away[0]))


def _starts(moves: Array) -> Array:
    return numpy.asarray(moves + numpy.array([[_QUARTER], [-_QUARTER], [0.0]]))


def _departures(set_name: str, friction: str, given: float, right: float) -> Iterator[str]:
    """Starts so far from the saddle, along its unstable eigenvector or another direction, that lead to this speed."""
    away = _leaving(set_name, friction, given)
    named = {"from the saddle along the unstable eigenvector": away}
    for place, name in enumerate(("beta", "gamma", "v")):
        named[f"in {name} from the saddle along the unstable eigenvector"] = away / away[place]
        named[f"from the saddle in {name} alone"] = numpy.eye(3)[place]
    for side, text in ((away * [1, 1, 0], "v left at zero"), (away * [1, 0, 1], "gamma left as it is")):
        named[f"from the saddle along the unstable eigenvector, {text}"] = side
    starts = list(itertools.product(named.items(), _SIZES))
    within = max(_LEAST, _WITHIN * abs(given - right))
    start = numpy.array([size * vector for (_, vector), size in starts for _ in range(2)]).T
    speeds = given + within * numpy.tile([-1.0, 1.0], len(starts))
    sides = _sides(field(set_name, friction, speeds), _starts(start))
    for ((name, _), size), below, above in zip(starts, sides[::2], sides[1::2], strict=True):
        if (below, above) == (1, -1):
            yield f"the search for Omega_h starts too far away: {size:g} {name}"


def _durations(set_name: str, friction: str, given: float, right: float) -> Iterator[str]:
    """Orbits that turn back, but are left just before that is noticed."""
    if given < right + _LATE:
        return
    away = _leaving(set_name, friction, given)
    y, f = _starts(away[:, None] * numpy.array(_FROM)), field(set_name, friction, numpy.full(len(_FROM), given))
    states = [y]
    for _ in range(round(_LONGEST / _H)):
        states.append(RK4(f, states[-1], _H))
    beta = numpy.stack(states)[:, 0]
    for lane, size in enumerate(_FROM):
        for beyond in _BEYOND:
            late = numpy.flatnonzero(beta[1:, lane] < _QUARTER - beyond)
            if not late.size:
                continue
            z, h = states[late[0]], numpy.zeros(len(_FROM))
            for _ in range(4):
                w = RK4(f, z, h)
                h = h + (_QUARTER - beyond - w[0]) / w[2]
            time = late[0] * _H + float(h[lane])
            if abs(time - _SHORT * round(time / _SHORT)) < _TIME:
                text = f"the search for Omega_h follows orbits for {time:.2f} s only, too short: by then the one that "
                text += f"starts {size:g} from the saddle has turned back at this speed"
                yield text + f" and is {beyond:g} rad beyond pi/2" * (beyond > 0)
                return


def _within(given: float, right: float) -> Array:
    return numpy.array([-1.0, 1.0]) * max(_LEAST, _EXACT * abs(given - right))


def _numbers(set_name: str, friction: str, given: float, right: float) -> Iterator[str]:
    """Round values of one parameter in the search alone."""
    point = stored().get(f"{set_name}/{friction}/heteroclinic/point/omega_h")
    p = vars(Model(Alternative("", ""), set_name, friction).p)
    lanes: list[tuple[str, float]] = []
    for name, slope in (point.condition if point is not None else {}).items():
        if name in p and float(slope):
            guess = p[name] * (1 + (given - right) / float(slope))
            short = [float(f"{guess:.{digits}g}") for digits in (1, 2, 3)] + list(_USUAL) * (name == "g")
            lanes += [(name, x) for x in dict.fromkeys(short) if abs(x - guess) < _LINEAR * abs(guess - p[name])]
    away = _starts(numpy.repeat(_NEAR * _leaving(set_name, friction, given)[:, None], 2, axis=1))
    for name in dict.fromkeys(name for name, _ in lanes):
        values = [x for one, x in lanes if one == name]
        speeds = numpy.tile(given + _within(given, right), len(values))
        f = field(set_name, friction, speeds, parameters={name: numpy.repeat(values, 2)})
        sides = _sides(f, numpy.tile(away, len(values)))
        for x, below, above in zip(values, sides[::2], sides[1::2], strict=True):
            if (below, above) == (1, -1):
                yield f"{name} = {x:g} instead of {p[name]:g} in the search for Omega_h alone"
                break


def _steps(set_name: str, friction: str, given: float, right: float) -> Iterator[str]:
    """Fixed steps that are too long."""
    speeds = numpy.tile(given + _within(given, right), len(_LENGTHS))
    away = _leaving(set_name, friction, given)
    start = _starts(numpy.repeat(_NEAR * away[:, None], len(speeds), axis=1))
    for name, method in _METHODS.items():
        lengths = numpy.repeat(_LENGTHS, 2)
        sides = _sides(field(set_name, friction, speeds), start, method, lengths)
        for h, below, above in zip(_LENGTHS, sides[::2], sides[1::2], strict=True):
            if (below, above) == (1, -1) and not (method is RK4 and h <= _H):
                yield f"the search for Omega_h integrates by {name} with too long a step, {h:g} s"


def _observed(set_name: str, friction: str, given: float, right: float) -> str:
    """What the orbit from the saddle does at the speed that was found."""
    f, y = (
        field(set_name, friction, numpy.array([given])),
        _starts(_NEAR * _leaving(set_name, friction, given)[:, None]),
    )
    text = "does neither within 6 s"
    for _ in range(round(_LONGEST / _H)):
        y = RK4(f, y, _H)
        if y[0, 0] < _QUARTER:
            short = f"{3 * _QUARTER - y[1, 0]:.2g} rad before the other saddle"
            text = f"turns back at gamma = {y[1, 0]:.3f}, {short}"
            break
        if y[1, 0] > 3 * _QUARTER:
            text = f"passes the other saddle {y[0, 0] - _QUARTER:.2g} rad beyond pi/2 in beta"
            break
    return (
        f"the search for Omega_h alone is off, by {given - right:.2g} rad/s: the eigenvalues are right there; next to "
        f"that speed the orbit from the saddle {text}: see its criterion, and its orbits' start, length and tolerance"
    )


def _sides(f: Field, y: Array, step: Step = RK4, h: Any = _H) -> Array:
    """1 for orbits that pass the other saddle, -1 for those that turn back before, 0 for neither."""
    sides = numpy.zeros(y.shape[1])
    with numpy.errstate(all="ignore"):
        for _ in range(round(_LONGEST / _H)):
            y = step(f, y, h)
            sides[(sides == 0) & (y[0] < _QUARTER - _BACK)] = -1
            sides[(sides == 0) & (y[1] > 3 * _QUARTER + _PAST)] = 1
            if sides.all():
                break
    return sides
