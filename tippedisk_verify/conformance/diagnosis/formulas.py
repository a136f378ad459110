"""Levels 3 and 8 with one thing changed in their formulas: conventions, another speed, other coefficients.

A candidate is a rank, a sentence and a function from the questions of one entry to its answers. Lower ranks say less
and are named first.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import lru_cache
from typing import Any

from tippedisk_verify.conformance.diagnosis.alternatives import Alternative
from tippedisk_verify.conformance.diagnosis.connection import searches
from tippedisk_verify.conformance.diagnosis.factors import LONG, critical_speed, model_bases, model_values, said_factor
from tippedisk_verify.conformance.diagnosis.matrices import matrices
from tippedisk_verify.conformance.diagnosis.predictions import Model, eigenvalues
from tippedisk_verify.conformance.diagnosis.recursion import series_changes
from tippedisk_verify.reference_values.store import Quantity
from tippedisk_verify.theory.expansion import cubic_acceleration, derived
from tippedisk_verify.theory.hopf import trilinear

__all__ = ["Candidate", "candidates", "conventions"]

Entries = Sequence[Sequence[Quantity]]
Answers = Mapping[str, float]
Numbers = dict[str, float]
Candidate = tuple[float, str, Callable[[Sequence[Quantity]], Numbers]]
_PLAIN = 1e-7  # relative: how near a factor is to a plain one
_CLOSE = 0.01  # relative: how far off a search may end
_SEARCHED = 3e-4  # relative: how far off a search ends that is meant to find the right speed
_MOST_DECIMALS = 8
_BY_C_1 = ("first_lyapunov_coefficient", "amplitude_squared_slope", "period_slope")
_SIMPLE = {"": 1.0, "2": 2.0, "1/2": 0.5, "4": 4.0, "1/4": 0.25, "8": 8.0, "1/8": 0.125, "16": 16.0, "1/16": 0.0625}


def candidates(entries: Entries, answers: Answers, wrong: set[str]) -> Iterator[Candidate]:
    """What one change makes of the level's answers; ``entries`` are its questions."""
    by_kind = {
        "hopf": _other_speeds, "equilibrium": matrices, "slow-manifold": series_changes,
        "heteroclinic": _spectra,
    }  # fmt: skip
    if (make := by_kind.get(entries[0][0].kind)) is not None:
        yield from make(entries, answers, wrong)


# ------------------------------------------------------------------------------------------ level 3
@lru_cache
def _normal_form(set_name: str, speed: float) -> dict[str, Any]:
    """The normal form of the field's expansion about inverted spinning, in double, as if this were the Hopf point."""
    import numpy
    from mpmath import fp

    p = model_values(set_name)
    parts = derived(p, speed)
    rest = parts.mass[0, 0, 0]
    last = [sum(part.get(one, 0.0) for part in parts[1:]) / rest for one in ((1, 0, 0), (0, 1, 0), (0, 0, 1))]
    matrix = numpy.array([[0, 0, 1], [speed, 0, 0], last])
    values, vectors = numpy.linalg.eig(matrix)
    place = int(numpy.argmax(values.imag))
    left = numpy.linalg.inv(vectors)[place]
    q = [complex(part) for part in vectors[:, place]]
    size = math.sqrt(sum(abs(part) ** 2 for part in q))
    q, left = [part / size for part in q], left * size
    cubic = left[2] * sum(value * trilinear(powers, q, fp) for powers, value in cubic_acceleration(parts).items())
    c_1 = complex(cubic + left[1] * trilinear((3, 0, 0), q, fp) * -speed / 6) / 2
    drift = complex(left[1] * q[0] + left[2] * (-2 * speed * q[0] + last[1] / speed * q[1]))
    omega = float(values[place].imag)
    rest = {"omega": omega, "q": q, "left": left, "turn": -2 * math.pi / omega**2}
    rest |= {"omega_crit": speed, "period": 2 * math.pi / omega}
    return rest | _following(rest, c_1, drift)


def _following(n: Mapping[str, Any], c_1: complex, drift: complex) -> dict[str, Any]:
    """What follows from z' = (i omega + drift (Omega - Omega_crit)) z + c_1 |z|^2 z."""
    growth = drift.real / c_1.real
    return {
        "first_lyapunov_coefficient": c_1.real / n["omega"], "transversality": drift.real,
        "amplitude_squared_slope": 4 * abs(n["q"][0]) ** 2 * growth,
        "period_slope": n["turn"] * (c_1.imag * growth - drift.imag), "c_1": c_1, "drift": drift, "growth": growth,
    }  # fmt: skip


def conventions(quantity: Quantity) -> Iterator[tuple[str, float]]:
    """What other conventions and half-done formulas make of one number of the Hopf point."""
    right, name = quantity.for_doubles, quantity.name
    p, n = model_values(quantity.set), _normal_form(quantity.set, critical_speed(quantity.set))
    sizes = [abs(part) ** 2 for part in n["q"]]
    times = "times the right value"
    norms = {"": 1.0} | {
        f"those of an eigenvector q whose component {part} is 1": 1 / size
        for part, size in zip(("beta", "gamma", "v"), sizes, strict=True)
    }
    if name == "first_lyapunov_coefficient":
        yield "the imaginary part of c_1 divided by omega", n["c_1"].imag / n["omega"]
        yield "the modulus of c_1 divided by omega", abs(n["c_1"]) / n["omega"]
        frequencies = {"": 1.0, "omega, the critical frequency,": n["omega"], "1/omega": 1 / n["omega"]}
        products = itertools.product(frequencies.items(), norms.items(), _SIMPLE.items())
        for (one, power), (norm, size), (text, number) in products:
            factor = f"{text} {one}".strip()
            said = ", ".join(part for part in (factor and f"{factor} {times}", norm) if part)
            yield said, right * power * size * number
    if name == "transversality":
        yield "the derivative of the imaginary part", n["drift"].imag
        yield "the modulus of the eigenvalue's derivative", abs(n["drift"])
    if name == "amplitude_squared_slope":
        for part, size in zip(("gamma", "v"), sizes[1:], strict=True):
            yield f"those for {part} instead of beta", right * size / sizes[0]
        yield "the slope of |z|^2, without the eigenvector", n["growth"]
    if name == "period_slope":
        yield "those without the cubic terms, of the linear part alone", n["turn"] * -n["drift"].imag
        yield "those of the cubic terms alone, at a fixed speed", n["turn"] * n["c_1"].imag * n["growth"]
        yield "those of the angular frequency instead of the period", right / n["turn"]
    if name in ("transversality", "amplitude_squared_slope", "period_slope"):
        yield "those per Omega^2 instead of per Omega", right / (2 * n["omega_crit"])
    if name in ("omega_crit", "period"):
        for text, base in model_bases(p).items():
            for power in (0.5, -0.5, 1, -1):
                yield f"{text}^{power:g} {times}", right * base**power


def _other_speeds(entries: Entries, answers: Answers, wrong: set[str]) -> Iterator[Candidate]:
    """Everything as it would be at the wrong Omega_crit that is answered."""
    for quantity in entries[0]:
        if quantity.name == "omega_crit" and quantity.id in wrong and answers[quantity.id] > 0:
            speed = answers[quantity.id]
            rank, text = said_factor(speed / quantity.for_doubles, model_values(quantity.set))
            if abs(speed / quantity.for_doubles - 1) < _SEARCHED:
                rank, text = _searched(speed, quantity.for_doubles)
            if rank < LONG:
                said = f"omega_crit {text}, and all else is taken there"
                yield rank, said, lambda here, speed=speed: _normal_form(here[0].set, speed)  # type: ignore[misc]
    yield from _other_coefficients(entries[0], answers, wrong)


def _searched(speed: float, right: float) -> tuple[float, str]:
    """Rank and words for a speed that is nearly right."""
    for decimals in range(_MOST_DECIMALS):
        if speed == round(right, decimals):
            return 0.5, f"is rounded to {decimals} decimals, by hand or by a scan in steps of 1e-{decimals}"
        if speed in (math.floor(right * 10**decimals) / 10**decimals, math.ceil(right * 10**decimals) / 10**decimals):
            way = "down" if speed < right else "up"
            return 0.5, f"is rounded {way} to {decimals} decimals, as by a scan in steps of 1e-{decimals}"
    text = f"is off by {speed - right:.1e} rad/s, as by a search that ends early, a scan or a number of few digits"
    return LONG - 2, text


def _other_coefficients(here: Sequence[Quantity], answers: Answers, wrong: set[str]) -> Iterator[Candidate]:
    """All that follows from another c_1, another slope of the eigenvalue, or another product with the adjoint.

    Two of the answers tell such a complex number; the others have to bear it out.
    """
    given = {quantity.name: answers[quantity.id] for quantity in here}
    bad = {quantity.name for quantity in here if quantity.id in wrong}
    n = _normal_form(here[0].set, critical_speed(here[0].set))
    if not {*_BY_C_1, "transversality"} <= given.keys() or not given["first_lyapunov_coefficient"]:
        return
    c_1, drift, coefficients = n["c_1"], n["drift"], []
    real, speed = given["first_lyapunov_coefficient"] * n["omega"], given["transversality"]
    if bad == set(_BY_C_1):
        imaginary = (given["period_slope"] / n["turn"] + drift.imag) / (drift.real / real)
        coefficients.append(("c_1, the coefficient of |z|^2 z,", c_1, complex(real, imaginary), drift))
    elif bad == {"transversality", *_BY_C_1[1:]}:
        imaginary = c_1.imag * speed / c_1.real - given["period_slope"] / n["turn"]
        coefficients.append(("d lambda/d Omega", drift, c_1, complex(speed, imaginary)))
    elif bad >= {"transversality", *_BY_C_1[:1]} and "omega_crit" not in bad:
        share = (real * drift.imag - speed * c_1.imag) / (c_1.real * drift.imag - c_1.imag * drift.real)
        factor = complex(share, (c_1.real * share - real) / c_1.imag)
        text = "the factor of all products with the adjoint eigenvector"
        coefficients.append((text, complex(1), factor * c_1, factor * drift))
        length = math.sqrt(sum(abs(part) ** 2 for part in n["left"]))
        for size, said in ((1.0, "|<p, q>| = 1, but not <p, q> = 1"), (1 / length, "length 1 instead of <p, q> = 1")):
            if abs(abs(factor) / size - 1) < _PLAIN:
                numbers = n | _following(n, factor * c_1, factor * drift)
                yield LONG - 2, f"the adjoint eigenvector p is scaled to {said}", lambda _, x=numbers: x  # type: ignore[misc]
    for text, right, other, moved in coefficients:
        value = other if right is c_1 else moved if right is drift else factor
        said = f"{text} is {value.real:.9g} {value.imag:+.9g} i instead of {right.real:.9g} {right.imag:+.9g} i: "
        numbers = n | _following(n, other, moved)
        yield LONG - 1, said + "a mistake in it or rounding, and all else follows from it", lambda _, x=numbers: x  # type: ignore[misc]


# ------------------------------------------------------------------------------------------ level 8
def _spectra(entries: Entries, answers: Answers, wrong: set[str]) -> Iterator[Candidate]:
    """The eigenvalues at the connection, taken at another speed or at the other equilibrium."""
    from scipy.optimize import brentq

    here = {quantity.name: quantity for quantity in entries[0]}
    if not {"omega_h", "lambda_u", "lambda_s", "lambda_ss"} <= here.keys():
        return
    first = entries[0][0]
    model = Model(Alternative("", ""), first.set, first.friction)
    given, right = answers[here["omega_h"].id], float(here["omega_h"])

    def parts(omega: float, side: int) -> list[float]:
        return [value.real for value in eigenvalues(model, omega, side)]

    def spectrum(omega: float, side: int) -> Callable[[Sequence[Quantity]], Numbers]:
        found = dict(zip(("lambda_u", "lambda_s", "lambda_ss"), parts(omega, side), strict=True))
        return lambda _: {"omega_h": given if here["omega_h"].id in wrong else right, **found}

    if here["omega_h"].id in wrong:
        for text in searches(first.set, first.friction, given, right):
            yield 0.5, text, spectrum(given, -1)
        if abs(given / right - 1) < _CLOSE:
            off = f"alone is off, by {given - right:.2g} rad/s: the eigenvalues are"
            if wrong == {here["omega_h"].id}:
                yield 1.0, f"omega_h {off} at the right speed", spectrum(right, -1)
            yield 2.0, f"the search for Omega_h {off} right there", spectrum(given, -1)
        return
    for side, name in ((-1, "noninverted"), (1, "inverted")):
        for omega, text in ((critical_speed(first.set), "Omega_crit"), (right, "Omega_h")):
            yield 1.0, f"the eigenvalues of the {name} state at {text}", spectrum(omega, side)
    wanted = answers[here["lambda_u"].id]
    if (parts(1.0, -1)[0] - wanted) * (parts(1000.0, -1)[0] - wanted) < 0:
        omega = float(brentq(lambda omega: parts(omega, -1)[0] - wanted, 1.0, 1000.0, xtol=1e-12))
        yield 2.0, f"the eigenvalues at another speed than Omega_h, {omega:.9g} rad/s", spectrum(omega, -1)
