"""The monodromy matrix and its Floquet vectors, at a cycle's section and along it."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction
from functools import lru_cache

import numpy
import pytest

import tippedisk_verify as tv
from tippedisk_verify.cycles.limit_cycle import Cycle
from tippedisk_verify.cycles.monodromy import FloquetVectors

_FIELDS = ("r", "e", "m", "A", "B", "g", "mu", "epsilon", "C", "friction")


@lru_cache(maxsize=2)
def _cycle(kind: str, digits: int = 12) -> Cycle:
    disk = tv.Disk("table1", friction="smooth" if kind == "smooth" else "linear")
    if kind == "rotating":
        return disk.rotating_cycle("30.02", digits=digits)
    if kind == "next to Omega_h":
        return disk.limit_cycle(above_het="1e-8")
    return disk.limit_cycle("30.4", digits=25 if kind == "wide" else digits)


def _quotients(sharp: Cycle, since: Fraction) -> numpy.typing.NDArray[numpy.float64]:
    """Return difference quotients in 25 digits over a period from a point of the cycle, each
    component moved by 1e-10.
    """
    step, disk = (
        Fraction(1, 10**10),
        tv.Disk(**{name: getattr(sharp.parameters, name) for name in _FIELDS}),
    )

    def end(point: list[Fraction], time: Fraction) -> numpy.typing.NDArray[numpy.object_]:
        found = disk.integrate(
            sharp.omega.value, point, time, t_eval=[time], digits=25, shifted=True
        )
        return numpy.array(found.end.state)

    point = [number.value for number in sharp._start]
    if since:
        point = [tv.exact(value).rational for value in end(point, since)]
    columns = []
    for place in range(3):
        ahead, behind = (
            end(
                [value + sign * step * (n == place) for n, value in enumerate(point)],
                sharp.period.value,
            )
            for sign in (1, -1)
        )
        columns.append((ahead - behind).astype(float) / float(2 * step))
    return numpy.column_stack(columns)


@pytest.mark.parametrize(
    ("kind", "since"),
    [
        ("limit", Fraction(1, 3)),
        *(
            pytest.param(kind, since, marks=pytest.mark.slow(minutes=0.3))
            for kind, since in [("rotating", Fraction(1, 2)), ("smooth", Fraction(1, 5))]
        ),
    ],
)
def test_it_is_what_difference_quotients_of_long_numbers_give(kind: str, since: Fraction) -> None:
    mine, sharp = _cycle(kind, 12), _cycle(kind, 28)
    truth, found = _quotients(sharp, since), mine.monodromy(since)
    assert (abs(found.matrix - truth) <= found.uncertainty + numpy.spacing(abs(truth))).all()
    # Twelve digits, less three for second derivatives
    assert (found.uncertainty <= 1e-9 * abs(truth).max()).all()
    slow = sorted(abs(numpy.linalg.eigvals(found)))[-2]
    # Ten times that, for the eigenvector's angle
    assert slow == pytest.approx(float(mine.multiplier_slow), abs=1e-8)
    assert found.log_multipliers == (
        mine.multipliers[0].log(),
        mine.log_multiplier_slow,
        mine.log_multiplier_fast,
    )
    with pytest.raises(tv.InputError, match="a time from 0 to"):
        found(100)


# ---------------------------------------------------------------------------------- Floquet vectors
_SLOW = pytest.mark.slow(minutes=0.2)


def _applied(vectors: FloquetVectors, vector: tuple[tv.Measured, ...]) -> list[tv.Measured]:
    """Return the monodromy matrix at the vectors' time, times a vector."""
    monodromy = vectors.cycle.monodromy(vectors.time)
    entries = zip(monodromy.matrix.tolist(), monodromy.uncertainty.tolist(), strict=True)
    rows = [[tv.Measured.of(*pair) for pair in zip(*row, strict=True)] for row in entries]
    return [sum(a * x for a, x in zip(row, vector, strict=True)) for row in rows]


@pytest.mark.parametrize(
    ("kind", "since"),
    [
        pytest.param("librating", "0", marks=_SLOW),
        ("librating", "0.3"),
        pytest.param("wide", "0", marks=_SLOW),
        pytest.param("rotating", "0.5", marks=_SLOW),
        pytest.param("smooth", "0.3", marks=_SLOW),
        pytest.param("next to Omega_h", "0", marks=_SLOW),
    ],
)
def test_the_matrix_multiplies_them(kind: str, since: str) -> None:
    cycle = _cycle(kind)
    vectors = cycle.floquet_vectors(since)
    triple = (vectors.flow, vectors.slow, vectors.fast)
    for vector, multiplier in zip(triple, cycle.multipliers, strict=True):
        for image, component in zip(_applied(vectors, vector), vector, strict=True):
            assert (image - multiplier * component).holds(0)
        assert (sum(x * x for x in vector) - 1).holds(0)
        # Half of a double's digits, with some to spare for the matrix.
        assert max(float(x.uncertainty) for x in vector) < 2.0**-26
    for vector in triple[1:]:
        assert max(vector, key=lambda x: abs(x.value)) > 0


@pytest.mark.parametrize("kind", ["librating", pytest.param("rotating", marks=_SLOW)])
def test_the_first_points_along_the_motion(kind: str) -> None:
    cycle = _cycle(kind)
    for index, time in enumerate(cycle.orbit(4)[0][:3]):
        rates = tv.Disk("table1").rhs(cycle.omega)(0, cycle.orbit(4)[1][:, index])
        flow = numpy.asarray(cycle.floquet_vectors(float(time)))[:, 0]
        # The states are doubles, and the field's slopes are below some hundred.
        assert numpy.allclose(flow, rates / numpy.linalg.norm(rates), rtol=0, atol=1e-12)


@pytest.mark.slow
def test_those_of_twelve_digits_hold_those_of_twenty_five() -> None:
    mine, truth = (_cycle(kind).floquet_vectors for kind in ("librating", "wide"))
    for name in ("flow", "slow", "fast"):
        for number, other in zip(getattr(mine, name), getattr(truth, name), strict=True):
            assert number.contains(other)


def test_no_vectors_where_multipliers_may_be_complex() -> None:
    cycle = _cycle("librating")
    pair = replace(cycle, log_multiplier_fast=cycle.log_multiplier_slow)
    with pytest.raises(tv.AccuracyError, match="complex pair"):
        _ = pair.floquet_vectors


def test_no_matrix_without_half_widths() -> None:
    cycle = tv.Disk("table1").limit_cycle("30.4", half_widths=False)
    with pytest.raises(tv.AccuracyError, match="half-widths"):
        _ = cycle.floquet_vectors


def test_a_matrix_prints_its_digits() -> None:
    monodromy = _cycle("librating").monodromy
    entry = str(monodromy).splitlines()[3].split(",")[0]
    value, width = entry.split(" ± ")
    assert tv.Measured.of(value, width).holds(monodromy[0, 0])
    assert monodromy.to_dict()["matrix"][0][0] == {"value": value.strip(), "uncertainty": width}
