"""The monodromy matrix, anywhere on a cycle."""

from __future__ import annotations

from fractions import Fraction

import numpy
import pytest

import tippedisk_verify as tv
from tippedisk_verify.cycles.limit_cycle import Cycle

_FIELDS = ("r", "e", "m", "A", "B", "g", "mu", "epsilon", "C", "friction")


def _cycle(kind: str, digits: int) -> Cycle:
    disk = tv.Disk("table1", friction="smooth" if kind == "smooth" else "linear")
    return (
        disk.rotating_cycle("30.02", digits=digits)
        if kind == "rotating"
        else disk.limit_cycle("30.4", digits=digits)
    )


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
