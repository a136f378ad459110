"""Errors that only their size and place tell: a tolerance, finite differences, crude crossings, single precision.

They come last, and are named where everything that they must leave right is right.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from statistics import median

from tippedisk_verify.conformance.diagnosis.differences import difference_of
from tippedisk_verify.conformance.diagnosis.relations import stem
from tippedisk_verify.conformance.diagnosis.shapes import Found
from tippedisk_verify.conformance.grading import Grade, as_decimal
from tippedisk_verify.reference_values.store import Store

__all__ = ["size_of"]

_LEAST_DIGITS = 3.0  # of the worst answer, where all that is wrong with it is a difference's error
_FREE = 4  # answers that have to be alike
_WITHOUT_ORBITS = 5  # the last such level
_SINGLE = 2.0**-24
_LEFT = 0.15  # of the errors, where slopes of two or three digits explain them
_NOISE = 16.0  # the spread of a logarithm that is rounding's
_CRUDE = 0.005  # s; a step that brings the samples in time out right is no longer
#: Errors as relative changes of all inputs together: SciPy's methods stay below at tolerances up to 1e-3 (RK45) or 1e-4
#: (LSODA, BDF), equations with one sign, power or moment of inertia wrong are above it on the scenes' orbits.
_INTEGRATED = 1.5e-4
#: Shares of the defects that no equations explain: up to 0.02 where equations are a little wrong, 0.45 where they jump
#: or change in time, from 0.6 on where an integrator chooses its steps.
_RULED, _UNRULED = 0.03, 0.6
_GROWN = 0.5  # of the middle error: that of the first samples is less, as an orbit's errors grow on the way
_DEFECT = 0.02  # rad, rad/s; changes of the equations that make no larger ones are small


def size_of(usable: Sequence[Grade], wrong: set[str], store: Store, equations_right: bool) -> Found | None:
    """Errors that their size and place tell; ``equations_right`` says that level 1 was passed."""
    failing = {stem(store[id_]) for id_ in wrong}
    passing = {stem(store[grade.id]) for grade in usable if not grade.failed} - failing
    digits = [grade.digits for grade in usable if grade.id in wrong]
    level = usable[0].level
    derivative = {name for name in failing if name.startswith("d") or name == "transversality"}
    several = len(derivative) > 1 and len(wrong) >= _FREE  # one alone may be a wrong formula's
    if level == 1 and failing == derivative:
        given = {grade.id: as_decimal(grade.answer) for grade in usable}
        if (text := difference_of([store[id_] for id_ in sorted(wrong)], given, store)) is not None:
            return (("differences", text),), frozenset(wrong)
    if failing == derivative and passing and several and min(digits) >= _LEAST_DIGITS:
        text = "finite differences: only derivatives are off, by a few of their last digits"
        if level > _WITHOUT_ORBITS:
            text = f"{text}; or the integrator's step or tolerance is too coarse for the variational equations"
        return (("differences", text),), frozenset(wrong)
    if failing == {"log_multiplier_fast"}:
        logarithms = {grade.id: float(as_decimal(grade.answer)) for grade in usable}
        bad = [logarithms[id_] for id_ in wrong]
        # An eigenvalue below 1e-16 of the largest is rounding in doubles, exp(-36.7), or what an integrator leaves.
        # The half map's is counted twice. Whatever its right value, rounding leaves about the same.
        right = [store[id_].for_doubles for id_ in wrong]
        alike = max(bad) - min(bad) < _NOISE and all(x > y + 10 for x, y in zip(bad, right, strict=True))
        if alike and all(-75 < x < -20 for x in bad) and all(y < -50 for y in right):
            text = "log_multiplier_fast: rounding, as of a monodromy matrix's eigenvalue; integrate the divergence"
            return (("rounding", text),), frozenset(wrong)
    if level == 1:
        off = [grade.off for grade in usable if math.isfinite(grade.off)]
        if off and max(off) < 64 * _SINGLE and median(off) > _SINGLE / 64:
            return (("single", "errors of the size of single precision"),), frozenset(wrong)
        return None
    if failing == {"period"} and level in (7, 9) and passing:
        off = [
            abs(float(as_decimal(grade.answer)) - store[grade.id].for_doubles) for grade in usable if grade.id in wrong
        ]
        if max(off) < _CRUDE:
            return (("crossings", "the period is located crudely, in steps or by straight lines"),), frozenset(wrong)
    if level != 6 or not equations_right:
        return None
    return _motion(usable, wrong, failing, passing, store)


def _motion(
    usable: Sequence[Grade], wrong: set[str], failing: set[str], passing: set[str], store: Store
) -> Found | None:
    """Trajectories by right equations: events located badly, or errors smaller than those of any wrong equation."""
    if all(name.startswith(("crossing_", "flat_time")) for name in failing) and {"beta", "gamma", "v"} <= passing:
        times = [
            abs(float(as_decimal(grade.answer)) - store[grade.id].for_doubles)
            for grade in usable
            if store[grade.id].name.startswith(("crossing_time", "flat_time"))
        ]
        if times and max(times) < _CRUDE:
            what, where = ("flat_time is", "") if failing == {"flat_time"} else ("crossings are", ", or not at pi/2")
            text = f"{what} located crudely, by straight lines or at steps{where}: samples in time are right"
            if failing <= {"crossing_gamma", "crossing_v"} and "crossing_time" in passing:
                text = f"{' and '.join(sorted(failing))}: of another instant than the crossing, whose time is right: "
                text += "of a step, or on a straight line"
            return (("crossings", text),), frozenset(wrong)
        return None
    samples = [grade for grade in usable if "@" in grade.id]
    if len(samples) < _FREE or _smooth(samples, store):
        return None
    from tippedisk_verify.conformance.diagnosis.defects import defects

    given = {grade.id: as_decimal(grade.answer) for grade in samples}
    off = {id_: abs(float(answer) - store[id_].for_doubles) for id_, answer in given.items()}
    first = min(float(id_.split("@")[1]) for id_ in given)
    begun = median(size for id_, size in off.items() if float(id_.split("@")[1]) == first)
    if begun > _GROWN * median(off.values()):  # not of orbits, but of what is said of them
        return None
    largest, left = defects([store[grade.id] for grade in samples], given) or (math.inf, math.nan)
    by_name = [[id_ in wrong for id_ in given if f"/{name}@" in id_] for name in ("beta", "gamma", "v")]
    everywhere = all(2 * sum(bad) > len(bad) for bad in by_name)  # not one orbit, and not one way of saying it
    ruled, unruled = left < _RULED, left > _UNRULED and largest < _DEFECT and everywhere
    if ruled or not (unruled or max(grade.off for grade in usable) <= _INTEGRATED):
        return None
    text = "the integrator's errors: a loose tolerance, too long a step, single precision, or states rounded or "
    text += "interpolated on the way"
    return (("tolerance", text),), frozenset(wrong)


def _smooth(samples: Sequence[Grade], store: Store) -> bool:
    """Whether slightly other parameters, speeds and starts give these errors: by the slopes that the reference knows.

    An integrator's errors are of all directions on the way, those of another model are the same ones on each orbit.
    """
    import numpy

    asked = [store[grade.id] for grade in samples]
    names = sorted({name for quantity in asked for name in quantity.condition})
    table = numpy.array([[float(quantity.condition.get(name, 0)) for name in names] for quantity in asked])
    errors = numpy.array([float(as_decimal(grade.answer)) - store[grade.id].for_doubles for grade in samples])
    weights = 1 / numpy.maximum(abs(table).sum(axis=1), 1e-300)
    shifts = numpy.linalg.lstsq(table * weights[:, None], errors * weights, rcond=1e-6)[0]
    left = (errors - table @ shifts) * weights
    return bool(numpy.linalg.norm(left) < _LEFT * numpy.linalg.norm(errors * weights))
