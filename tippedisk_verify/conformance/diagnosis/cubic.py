"""Level 3's c_1 with third derivatives by differences over too long a step, or taken at another state."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any

from tippedisk_verify.conformance.diagnosis.alternatives import Alternative
from tippedisk_verify.conformance.diagnosis.predictions import Model

__all__ = ["other_c_1"]

_DIGITS = 60  # of the differences, so that rounding leaves nothing in them
_FINE = 1e-9  # a step that leaves twelve digits
_PROBE = 1e-3  # a step whose error is the leading term
_ITERATIONS = 8
_SOLVED = 1e-13  # relative
_ANGLES = {"0": 0.0, "pi/2": math.pi / 2, "-pi/2": -math.pi / 2, "pi": math.pi}


def other_c_1(n: Mapping[str, Any], set_name: str, wanted: complex) -> Iterator[tuple[float, str, complex]]:
    """(rank, how c_1 is formed, c_1), of the critical eigenvectors that ``n`` has; a step is solved for.

    The real part of ``wanted`` tells the step; the imaginary one has to bear it out.
    """
    for text, form in _STENCILS.items():
        right = form(n, set_name, _FINE)
        move = (form(n, set_name, _PROBE) - right).real / _PROBE**2
        square = (wanted - right).real / move if move else 0.0
        if not 0 < square < 1:
            continue
        ends = [0.9 * square, square]
        errors = [form(n, set_name, math.sqrt(x)).real - wanted.real for x in ends]
        for _ in range(_ITERATIONS):
            if abs(errors[-1]) <= _SOLVED * abs(wanted) or errors[-1] == errors[-2]:
                break
            x = ends[-1] - errors[-1] * (ends[-1] - ends[-2]) / (errors[-1] - errors[-2])
            if not 0 < x < 1:
                break
            ends.append(x)
            errors.append(form(n, set_name, math.sqrt(x)).real - wanted.real)
        step = math.sqrt(ends[-1])
        yield 3.0, f"c_1 has third derivatives by {text} over steps of about {step:.2g}", form(n, set_name, step)
    for (beta, x), (gamma, y) in itertools.product(_ANGLES.items(), repeat=2):
        if (x, y) != (math.pi / 2, math.pi / 2):
            text = f"c_1 has the third derivatives at beta = {beta}, gamma = {gamma}"
            yield 2.0, text, _along_complex(n, set_name, _FINE, (x, y, 0.0))


def _odd(set_name: str, speed: float, state: Sequence[float], move: Sequence[Any]) -> list[Any]:
    """The odd part of (gamma', v') along a move."""
    import mpmath

    model = Model(Alternative("", ""), set_name, "linear")
    sides = [
        model.parts(mpmath, speed, [mpmath.mpf(x) + sign * dx for x, dx in zip(state, move, strict=True)])
        for sign in (1, -1)
    ]
    return [(sides[0][name] - sides[1][name]) / 2 for name in ("gamma_rate", "v_rate")]


def _product(n: Mapping[str, Any], parts: Sequence[Any]) -> complex:
    left = n["left"]
    return complex(left[1]) * complex(parts[0]) / 2 + complex(left[2]) * complex(parts[1]) / 2


_INVERTED = (math.pi / 2, math.pi / 2, 0.0)


def _cube(n: Mapping[str, Any], set_name: str, step: float, state: Sequence[float], along: Sequence[Any]) -> list[Any]:
    """The third derivative along a direction: (f(2 d) - 2 f(d) + 2 f(-d) - f(-2 d)) / (2 d^3)."""
    one, two = (_odd(set_name, n["omega_crit"], state, [k * step * x for x in along]) for k in (1, 2))
    return [(b - 2 * a) / step**3 for a, b in zip(one, two, strict=True)]


def _along_complex(n: Mapping[str, Any], set_name: str, step: float, state: Sequence[float] = _INVERTED) -> complex:
    """C(q, q, conj q) from the cubes of q + conj q, q - conj q and conj q."""
    import mpmath

    with mpmath.workdps(_DIGITS):
        q = [mpmath.mpc(x) for x in n["q"]]
        bar = [x.conjugate() for x in q]
        plus, minus = ([x + sign * y for x, y in zip(q, bar, strict=True)] for sign in (1, -1))
        a, b, c = (_cube(n, set_name, step, state, along) for along in (plus, minus, bar))
        return _product(n, [(x - y - 2 * z) / 6 for x, y, z in zip(a, b, c, strict=True)])


def _along_real(n: Mapping[str, Any], set_name: str, step: float) -> complex:
    """The same from real and imaginary part x and y of q: C(x,x,x) + C(x,y,y) + i (C(x,x,y) + C(y,y,y))."""
    import mpmath

    with mpmath.workdps(_DIGITS):
        x, y = ([mpmath.mpf(part) for part in parts] for parts in zip(*((z.real, z.imag) for z in n["q"]), strict=True))
        plus, minus = ([a + sign * b for a, b in zip(x, y, strict=True)] for sign in (1, -1))
        cubes = [_cube(n, set_name, step, _INVERTED, along) for along in (x, y, plus, minus)]
        found = []
        for xxx, yyy, more, less in zip(*cubes, strict=True):
            xyy, xxy = (more + less - 2 * xxx) / 6, (more - less - 2 * yyy) / 6
            found.append(mpmath.mpc(xxx + xyy, xxy + yyy))
        return _product(n, found)


def _nested(n: Mapping[str, Any], set_name: str, step: float) -> complex:
    """The same from the array of third derivatives, each a central difference of central differences."""
    import mpmath

    with mpmath.workdps(_DIGITS):
        q, total = [mpmath.mpc(x) for x in n["q"]], [mpmath.mpc(0), mpmath.mpc(0)]
        for places in itertools.combinations_with_replacement(range(3), 3):
            derivative = [mpmath.mpf(0), mpmath.mpf(0)]
            for signs in itertools.product((1, -1), repeat=2):  # the other half has the other sign, and is odd
                move = [mpmath.mpf(0)] * 3
                for place, sign in zip(places, (1, *signs), strict=True):
                    move[place] += sign * step
                odd = _odd(set_name, n["omega_crit"], _INVERTED, move)
                derivative = [
                    x + math.prod(signs) * y / (4 * mpmath.mpf(step) ** 3) for x, y in zip(derivative, odd, strict=True)
                ]
            orders = set(itertools.permutations(places))
            share = sum(q[i] * q[j] * q[k].conjugate() for i, j, k in orders)
            total = [x + share * y for x, y in zip(total, derivative, strict=True)]
        return _product(n, total)


_STENCILS: dict[str, Callable[..., complex]] = {
    "differences along q + conj q, q - conj q and conj q": _along_complex,
    "differences along the real and imaginary parts of q": _along_real,
    "central differences of central differences": _nested,
}
