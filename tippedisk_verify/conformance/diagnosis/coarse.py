"""Numbers of cycles that are approximations: the largest deflection at a step, the asymptotic laws next to Omega_h."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from decimal import Decimal
from functools import partial
from typing import Any

import numpy

from tippedisk_verify.conformance.diagnosis.alternatives import Alternative
from tippedisk_verify.conformance.diagnosis.flights import Array, field, flown
from tippedisk_verify.conformance.diagnosis.predictions import Model
from tippedisk_verify.conformance.diagnosis.predictions import eigenvalues as eigenvalues_at
from tippedisk_verify.conformance.diagnosis.shapes import Found, borne_out
from tippedisk_verify.conformance.diagnosis.shooting import half_orbits
from tippedisk_verify.conformance.grading import Grade, as_decimal, needed
from tippedisk_verify.reference_values.store import Quantity, Store

__all__ = ["coarse_of"]

_FREE = 3  # wrong answers that must bear out a round step
_LINE = 4  # answers on a straight line, one of which tells it
_LEAST_DIGITS = 3.0  # that a question must need for this
_STEPS = 600
_LONGEST = 0.1  # s from the turning point
_IRREGULAR = 3.0  # times: times to the turning point that differ as much, up and down, follow no formula
_GRIDS = {f"{m}e-{k} s": m * 10.0**-k for k in (2, 3, 4) for m in (1, 2, 2.5, 4, 5)}
_PARTS = (50, 64, 100, 128, 200, 250, 256, 300, 400, 500, 512, 600, 800, 1000, 1024, 2000, 2048)


def coarse_of(usable: Sequence[Grade], wrong: set[str], store: Store) -> Found | None:
    """What explains the wrong quantities of cycles, each by itself."""
    given = {grade.id: as_decimal(grade.answer) for grade in usable}
    said, tried = [], set()
    for name in dict.fromkeys(store[grade.id].name for grade in usable if grade.id in wrong):
        here = [store[grade.id] for grade in usable if store[grade.id].name == name]
        text = (_at_steps if name == "beta_max" else partial(_law, name))(here, given, wrong, store)
        if text is None:
            return None
        said.append(f"{name}: {text}")
        tried |= {quantity.id for quantity in here if name == "beta_max" or needed(quantity) >= _LEAST_DIGITS}
    return ((("coarse", "; ".join(said)),), frozenset(wrong & tried)) if wrong & tried else None


def _fits(here: Sequence[Quantity], expected: Array, given: Mapping[str, Decimal], wrong: set[str]) -> bool:
    return all(
        borne_out(given[quantity.id], float(x), quantity, quantity.id in wrong) is not None
        for quantity, x in zip(here, expected, strict=True)
    )


# ------------------------------------------------------------------------------------------ beta_max
def _at_steps(here: Sequence[Quantity], given: Mapping[str, Decimal], wrong: set[str], store: Store) -> str | None:
    """Deflections at times of a grid that begins at the section, or else of unknown steps."""
    low = numpy.array([quantity.for_doubles - float(given[quantity.id]) for quantity in here])
    bad = numpy.array([quantity.id in wrong for quantity in here])
    if bad.sum() < _FREE or (low[bad] < 0).any():
        return None
    period, gamma, v = (
        numpy.array([store[quantity.id.replace("beta_max", name)].for_doubles for quantity in here])
        for name in ("period", "gamma_bar_0", "v_0")
    )
    first, omega = here[0], numpy.array([float(quantity.inputs["Omega"]) for quantity in here])
    run = half_orbits(first.set, first.friction, period / 2, gamma, v, omega)
    start = numpy.stack([numpy.full(len(here), math.pi / 2), math.pi / 2 + gamma, v])
    grids = {text: numpy.full(len(here), size) for text, size in _GRIDS.items()}
    grids |= {f"period/{n}": period / n for parts in _PARTS for n in (parts, parts - 1)}
    before = numpy.array([numpy.floor(run.turning / size) * size for size in grids.values()])
    times = numpy.concatenate([before, before + numpy.array(list(grids.values()))])
    count = len(times)
    ends = flown(
        field(first.set, first.friction, numpy.tile(omega, count)), numpy.tile(start, count), times.ravel(), _STEPS
    )
    sooner, later = (math.pi / 2 - ends[0]).reshape(2, len(grids), len(here))
    for n, text in enumerate(grids):
        for deepest, which in (
            (numpy.maximum(sooner, later), "the largest of the states"),
            (sooner, "the last state before the turning point"),
            (later, "the first state after the turning point"),
        ):
            if _fits(here, deepest[n], given, wrong):
                return f"{which} at steps of {text}, not the one where v = 0"
    speed = field(first.set, first.friction, omega)
    turned = flown(speed, start, run.turning, _STEPS)
    apart = numpy.sqrt(2 * low[bad] / speed(turned)[2, bad])[numpy.argsort(omega[bad])]
    turns = numpy.diff(numpy.sign(numpy.diff(apart)))
    if not (apart < _LONGEST).all() or (turns != 0).sum() < 2 or apart.max() < _IRREGULAR * apart.min():
        return None
    return (
        f"too small by what a state has that is up to {float(f'{1e3 * apart.max():.1g}'):g} ms from the turning point, "
        "now more and now less: taken at steps, not where v = 0, or that instant is refined wrongly"
    )


# ------------------------------------------------------------------------------------------ next to Omega_h
def _law(
    name: str, here: Sequence[Quantity], given: Mapping[str, Decimal], wrong: set[str], store: Store
) -> str | None:
    """A line in the logarithm of the distance from Omega_h with the slope that eigenvalues there give, or its power."""
    told = [quantity for quantity in here if needed(quantity) >= _LEAST_DIGITS]
    point = f"{here[0].set}/{here[0].friction}/heteroclinic/point"
    if here[0].kind != "near-heteroclinic" or f"{point}/omega_h" not in store or len(told) < _LINE:
        return None
    base = Decimal(store[f"{point}/omega_h"].values["decimals"][0])
    away = numpy.array([float(Decimal(quantity.inputs["Omega"]) - base) for quantity in told])
    y = numpy.array([float(given[quantity.id]) for quantity in told])
    up, down, fast = (store[f"{point}/{name}"].for_doubles for name in ("lambda_u", "lambda_s", "lambda_ss"))
    far = int(numpy.argmax(away))  # doubles leave most digits there
    found: list[tuple[str, Array]] = []
    eigenvalues = {"lambda_u": up, "lambda_s": down, "lambda_ss": fast}
    if name == "dperiod_domega":
        model = Model(Alternative("", ""), here[0].set, here[0].friction)
        spectra = [eigenvalues_at(model, float(quantity.inputs["Omega"]), -1) for quantity in told]
        there = zip(eigenvalues, numpy.array([[x.real for x in one] for one in spectra]).T, strict=True)
        both: list[tuple[str, Any]] = [*eigenvalues.items(), *((f"{text}(Omega)", values) for text, values in there)]
        found = [
            (f"{k} / ({text} (Omega - Omega_h))", k / value / away)
            for k in (-2, -1, 2, 1, -4, 4)
            for text, value in both
        ]
        found.append((f"{y[far] * away[far]:.6g} / (Omega - Omega_h)", y[far] * away[far] / away))
    if name.startswith("log_multiplier"):
        period = numpy.array([store[quantity.id.replace(name, "period")].for_doubles for quantity in told])
        sums = {"lambda_u + lambda_s": up + down, "lambda_s + lambda_ss": down + fast, "lambda_u - lambda_s": up - down}
        found += [
            (f"({text}) T{part}".replace("(lambda_ss)", "lambda_ss"), share * value * period)
            for text, value in (sums | {"lambda_ss": fast, "lambda_u": up, "lambda_s": down}).items()
            for part, share in (("", 1.0), ("/2", 0.5))
        ]
    logarithms = {"log": numpy.log(away), "log10": numpy.log10(away)}
    index = -2 * (down / up + 1)
    slopes = {
        "period": {f"{k}/{text}": k / value for k in (-2, -1, 2, 1, -4, 4) for text, value in eigenvalues.items()},
        "log_multiplier_slow": {"-2 (lambda_s/lambda_u + 1)": index, "-(lambda_s/lambda_u + 1)": index / 2},
        "log_multiplier_fast": {"-2 lambda_ss/lambda_u": -2 * fast / up, "-lambda_ss/lambda_u": -fast / up},
    }.get(name, {})
    for (text, slope), (log, x) in itertools.product(slopes.items(), logarithms.items()):
        for constant in (0.0, float(y[far] - slope * x[far])):
            rest = f" {'-' if constant < 0 else '+'} {abs(constant):.6g}" if constant else ""
            found.append((f"{text} {log}(Omega - Omega_h){rest}", slope * x + constant))
    for text, power in (("2", index), ("", index / 2)) if name == "multiplier_slow" else ():
        for front, constant in (("", 1.0), ("a constant times ", y[far] / away[far] ** power)):
            words = f"{front}(Omega - Omega_h)^(-{text}{' ' * bool(text)}(lambda_s/lambda_u + 1))"
            found.append((words, constant * away**power))
    return next(
        (f"{text}, an asymptotic law, not the cycle's" for text, x in found if _fits(told, x, given, wrong)), None
    )
