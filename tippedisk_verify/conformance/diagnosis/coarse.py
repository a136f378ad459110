"""Numbers of cycles that are approximations: the largest deflection at a step, the asymptotic laws next to Omega_h."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from decimal import Decimal

import numpy

from tippedisk_verify.conformance.diagnosis.flights import field, flown
from tippedisk_verify.conformance.diagnosis.shapes import Found, borne_out
from tippedisk_verify.conformance.diagnosis.shooting import half_orbits
from tippedisk_verify.conformance.grading import Grade, as_decimal, needed
from tippedisk_verify.reference_values.store import Quantity, Store

__all__ = ["coarse_of"]

_FREE = 3  # wrong answers that must bear out a round step
_LINE = 5  # answers on a straight line, two of which tell it
_ZERO = 1e-5  # s
_LEAST_DIGITS = 3.0  # that a question must need for this
_STEPS = 600
_LONGEST = 0.02  # s; of a step
_IRREGULAR = 3.0  # times: times to the turning point that differ as much, up and down, follow no formula
_GRIDS = {f"{m}e-{k} s": m * 10.0**-k for k in (2, 3, 4) for m in (1, 2, 2.5, 4, 5)}
_PARTS = (50, 64, 100, 128, 200, 250, 256, 300, 400, 500, 512, 600, 800, 1000, 1024, 2000, 2048)


def coarse_of(usable: Sequence[Grade], wrong: set[str], store: Store) -> Found | None:
    """What explains one wrong quantity of cycles, all else being right."""
    names = {store[id_].name for id_ in wrong}
    if len(names) != 1:
        return None
    given = {grade.id: as_decimal(grade.answer) for grade in usable}
    here = [store[grade.id] for grade in usable if store[grade.id].name in names]
    if names != {"beta_max"}:
        here = [quantity for quantity in here if needed(quantity) >= _LEAST_DIGITS]
    text = _at_steps(here, given, wrong, store) if names == {"beta_max"} else _law(here, given, store, wrong)
    return ((("coarse", text),), frozenset(wrong & {quantity.id for quantity in here})) if text else None


def _fits(here: Sequence[Quantity], expected: Sequence[float], given: Mapping[str, Decimal], wrong: set[str]) -> bool:
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
                return f"beta_max: {which} at steps of {text}, not the one where v = 0"
    speed = field(first.set, first.friction, omega)
    turned = flown(speed, start, run.turning, _STEPS)
    apart = numpy.sqrt(2 * low[bad] / speed(turned)[2, bad])[numpy.argsort(omega[bad])]
    turns = numpy.diff(numpy.sign(numpy.diff(apart)))
    if not (apart < _LONGEST).all() or (turns != 0).sum() < 2 or apart.max() < _IRREGULAR * apart.min():
        return None
    return (
        "beta_max: too small by what a state has that is up to "
        f"{1e3 * apart.max():.1g} ms from the turning point, now more and now less: taken at steps, not where v = 0"
    )


# ------------------------------------------------------------------------------------------ next to Omega_h
def _law(told: Sequence[Quantity], given: Mapping[str, Decimal], store: Store, wrong: set[str]) -> str | None:
    """A straight line in the logarithm of the distance from Omega_h, of the answers or of their logarithms."""
    if len(told) < _LINE or wrong.isdisjoint(quantity.id for quantity in told):
        return None
    first = told[0]
    point = f"{first.set}/{first.friction}/heteroclinic/point"
    if first.kind != "near-heteroclinic" or f"{point}/omega_h" not in store:
        return None
    base = Decimal(store[f"{point}/omega_h"].values["decimals"][0])
    x = numpy.array([math.log(Decimal(quantity.inputs["Omega"]) - base) for quantity in told])
    y = numpy.array([float(given[quantity.id]) for quantity in told])
    up, down = (store[f"{point}/{name}"].for_doubles for name in ("lambda_u", "lambda_s"))
    for text, slope in {"-2/lambda_u": -2 / up, "2/lambda_s": 2 / down, "-1/lambda_u": -1 / up}.items():
        constant = y[0] - slope * x[0]
        if _fits(told, slope * x + constant, given, wrong):
            rest = f" + {constant:.6g}" if abs(constant) > _ZERO else ""
            return f"{first.name}: {text} log(Omega - Omega_h){rest}, an asymptotic law, not the cycle's"
    ends = [int(numpy.argmin(x)), int(numpy.argmax(x))]
    for power in (False, True):
        if power and not (y * y[0] > 0).all():
            continue
        z = numpy.log(abs(y)) if power else y
        slope = float((z[ends[1]] - z[ends[0]]) / (x[ends[1]] - x[ends[0]]))
        line = z[ends[0]] + slope * (x - x[ends[0]])
        if _fits(told, numpy.sign(y[0]) * numpy.exp(line) if power else line, given, wrong):
            what = (
                f"a constant times (Omega - Omega_h)^{slope:.6g}"
                if power
                else f"{slope:.6g} log(Omega - Omega_h) + a constant"
            )
            return f"{first.name}: {what}, an asymptotic law, not the cycle's"
    return None
