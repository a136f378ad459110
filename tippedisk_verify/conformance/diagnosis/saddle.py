"""Level 8 where Omega_h is right: ratios and sums for eigenvalues, another matrix, the rolling disk's saddle."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from decimal import Decimal
from typing import Any

import numpy

from tippedisk_verify.conformance.diagnosis.alternatives import ALTERNATIVES, CORRECT, Alternative
from tippedisk_verify.conformance.diagnosis.flights import Array
from tippedisk_verify.conformance.diagnosis.predictions import Model, eigenvalues
from tippedisk_verify.conformance.diagnosis.shapes import Found, borne_out
from tippedisk_verify.conformance.grading import Grade, as_decimal
from tippedisk_verify.model.parameters import SYMBOLS
from tippedisk_verify.reference_values.store import Quantity, Store

__all__ = ["saddle_of"]

_NAMES = ("lambda_u", "lambda_s", "lambda_ss")
_ENTRIES = ("dv'/dv", "dv'/dbeta", "dgamma'/dbeta times dv'/dgamma")
_ALIKE = 1e-6  # relative: how near to 1 a factor is none
_DIGITS = 2  # of another factor
_SHARES = (0.7, 1.4)  # of a parameter, between which another value is looked for
_SIGNS = {"": 1.0, "minus ": -1.0}


def saddle_of(usable: Sequence[Grade], wrong: set[str], store: Store) -> Found | None:
    """What was answered for the eigenvalues at the right Omega_h: of another matrix, or one by one."""
    given = {grade.id: as_decimal(grade.answer) for grade in usable}
    here = {store[grade.id].name: store[grade.id] for grade in usable}
    bad = [name for name in _NAMES if name in here and here[name].id in wrong]
    if not {"omega_h", *_NAMES} <= here.keys() or here["omega_h"].id in wrong:
        return None
    first = here["omega_h"]
    model = Model(Alternative("", ""), first.set, first.friction)
    (a, _, _), (b, c, d) = model.jacobian(first.for_doubles, (math.pi / 2, -math.pi / 2, 0.0))
    matrix = numpy.array([[0.0, 0.0, 1.0], [a, 0.0, 0.0], [b, c, d]])
    fast = float(given[here["lambda_ss"].id])
    spectra = itertools.chain(
        _terms(first),
        sorted(_parameters(first, fast), key=lambda one: len(one[0])),
        _matrices(matrix, [float(given[here[name].id]) for name in _NAMES]),
    )
    for text, values in spectra:
        numbers = dict(zip(_NAMES, sorted(values, reverse=True), strict=True))
        if all(_fits(here[name], numbers[name], given, wrong) for name in _NAMES):
            return (("saddle", text),), frozenset(wrong)
    right = {name: here[name].for_doubles for name in ("omega_h", *_NAMES)}
    said = []
    for name in bad:
        others = (text for text, x in _made(right, model.p, name) if _fits(here[name], x, given, wrong))
        if (made := next(others, None)) is None:
            return None
        said.append(f"{name}: {made}")
    return ((("saddle", "; ".join(said)),), frozenset(wrong)) if said else None


def _fits(quantity: Quantity, expected: float, given: dict[str, Decimal], wrong: set[str]) -> bool:
    return borne_out(given[quantity.id], expected, quantity, quantity.id in wrong) is not None


def _terms(first: Quantity) -> Iterator[tuple[str, list[float]]]:
    """Real eigenvalues with one term of the equations left out or of the wrong sign, or with one known mistake."""
    for words, factor in (("without", 0.0), ("with the wrong sign of", -1.0)):
        changed: dict[str, dict[str, Any]] = {
            f"h's term {n + 1}": {"h": tuple(factor if k == n else 1.0 for k in range(5))} for n in range(5)
        }
        for name, change in (changed | {"gravity": {"gravity": factor}}).items():
            other = Model(Alternative("", "", replace(CORRECT, **change)), first.set, first.friction)
            values = eigenvalues(other, first.for_doubles, -1)
            if not any(value.imag for value in values):
                yield f"the eigenvalues of the saddle's matrix {words} {name}", [value.real for value in values]

    for one in ALTERNATIVES:
        if one.of_the_model and (one.parameters is not None or one.spelling != CORRECT):
            values = eigenvalues(Model(one, first.set, first.friction), first.for_doubles, -1)
            if not any(value.imag for value in values):
                yield f"the eigenvalues of the saddle's matrix alone: {one.cause}", [value.real for value in values]
    model = Model(Alternative("", ""), first.set, first.friction)
    for beta, gamma in itertools.product(range(3), range(3)):
        state = beta * math.pi / 2, (gamma - 1) * math.pi / 2, 0.0
        matrix = numpy.array([[0.0, 0.0, 1.0], *model.jacobian(first.for_doubles, state)])
        values = numpy.linalg.eigvals(matrix).tolist()
        if not any(value.imag for value in values):
            where = f"beta = {beta}/2 pi, gamma = {gamma - 1}/2 pi"
            yield f"the eigenvalues of the matrix at {where}", [value.real for value in values]


def _parameters(first: Quantity, fast: float) -> Iterator[tuple[str, list[float]]]:
    """Real eigenvalues with another value of one parameter, which lambda_ss tells and the others bear out."""
    from scipy.optimize import brentq

    p = vars(Model(Alternative("", ""), first.set, first.friction).p)

    def values(name: str, x: float) -> list[float]:
        other = Model(Alternative("", "", parameters=lambda _: {name: x}), first.set, first.friction)
        return [value.real for value in eigenvalues(other, first.for_doubles, -1)]

    for name in SYMBOLS:
        ends = [values(name, share * p[name])[2] - fast for share in _SHARES]
        if ends[0] * ends[1] < 0:
            low, high = (share * p[name] for share in _SHARES)
            x = float(brentq(lambda x, name=name: values(name, x)[2] - fast, low, high, xtol=1e-18, rtol=1e-14))
            short = float(f"{x:.3g}")
            x = short if abs(short - x) < _ALIKE * x else x
            yield (
                f"the eigenvalues of the saddle's matrix alone: {name} = {x:.9g} instead of {p[name]:.9g}",
                values(name, x),
            )


def _matrices(matrix: Array, answers: list[float]) -> Iterator[tuple[str, list[float]]]:
    """Real eigenvalues of changed matrices; a factor on one entry is read off the sums and products of the answers."""
    for text, other in (
        ("its lower triangle made symmetric", numpy.tril(matrix) + numpy.tril(matrix, -1).T),
        ("its upper triangle made symmetric", numpy.triu(matrix) + numpy.triu(matrix, 1).T),
        ("its symmetric part", (matrix + matrix.T) / 2),
    ):
        yield f"the eigenvalues of the saddle's matrix with {text}", numpy.linalg.eigvalsh(other).tolist()
    blocks = (("beta and v", 1), ("gamma and v", 0), ("beta and gamma", 2))
    for text, left_out in blocks:
        block: Array = numpy.delete(numpy.delete(matrix, left_out, 0), left_out, 1)
        pair: Array = numpy.linalg.eigvals(block)
        if not numpy.iscomplex(pair).any():
            yield f"the eigenvalues of the block of {text} alone, and 0", [*pair.real.tolist(), 0.0]
    x, y, z = answers
    right = [matrix[2, 2], matrix[2, 0], matrix[1, 0] * matrix[2, 1]]
    factors = [n / m for n, m in zip((x + y + z, -(x * y + y * z + z * x), x * y * z), right, strict=True)]
    changed = [n for n, factor in enumerate(factors) if abs(factor - 1) > _ALIKE]
    if len(changed) == 1:
        factor = factors[changed[0]]
        short = float(f"{factor:.{_DIGITS}g}") if abs(factor) > _ALIKE else 0.0
        factor = short if abs(factor - short) < _ALIKE else factor
        said = {0.0: "is missing", -1.0: "has the wrong sign"}.get(factor, f"is {factor:.6g} times as large")
        yield f"in the saddle's matrix {_ENTRIES[changed[0]]} {said}", answers


def _made(right: dict[str, float], p: object, name: str) -> Iterator[tuple[str, float]]:
    """Numbers made of Omega_h and the eigenvalues, and those of the disk that rolls."""
    omega = right["omega_h"]
    r, e = (float(getattr(p, letter)) for letter in "re")
    for (sign, x), (text, reach) in itertools.product(_SIGNS.items(), (("r - e", r - e), ("r + e", r + e), ("r", r))):
        yield f"{sign}Omega_h sqrt(e/({text})), the saddle of rolling, without slip", x * omega * math.sqrt(e / reach)
    yield "-(mu m g (r - e)^2)/(epsilon Bbar), the friction alone", -_friction(p)
    for sign, x in _SIGNS.items():
        for (one, a), (other, b) in itertools.permutations(right.items(), 2):
            yield f"{sign}{one}/{other} is answered", x * a / b
        for (one, a), (other, b) in itertools.combinations(right.items(), 2):
            yield f"{sign}({one} + {other}) is answered", x * (a + b)
            yield f"{sign}({one} - {other}) is answered", x * (a - b)
            yield f"{sign}{one} {other} is answered", x * a * b
    mine = right[name]
    turn = 2 * math.pi / omega
    yield f"{name} per revolution, times 2 pi/Omega_h, is answered", mine * turn
    yield f"the multiplier over a revolution, exp(2 pi {name}/Omega_h), is answered", math.exp(min(mine * turn, 700.0))
    yield f"the time constant 1/abs({name}) is answered", 1 / abs(mine)


def _friction(p: object) -> float:
    r, e, m, g, mu, epsilon, bbar = (float(getattr(p, x)) for x in ("r", "e", "m", "g", "mu", "epsilon", "Bbar"))
    return mu * m * g * (r - e) ** 2 / (epsilon * bbar)
