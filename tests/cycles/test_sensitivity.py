"""The derivatives of a cycle's numbers by the parameters of the disk and by the speed."""

from __future__ import annotations

from fractions import Fraction
from functools import lru_cache

import pytest

import tippedisk_verify as tv
from tippedisk_verify.cycles.limit_cycle import Cycle
from tippedisk_verify.errors import NoConnectionError
from tippedisk_verify.model.parameters import SYMBOLS
from tippedisk_verify.theory.hopf import omega_crit_squared

#: The sums of exponents with which numbers scale: masses, lengths and times.
_MASS = {"m": 1, "A": 1, "B": 1}
_LENGTH = {"r": 1, "e": 1, "A": 2, "B": 2, "g": 1, "epsilon": 1}
_TIME = {"g": -2, "epsilon": -1, "omega": -1}
_SLOW = pytest.mark.slow(minutes=0.5)


@lru_cache(maxsize=2)
def _cycle(law: str, kind: str) -> Cycle:
    disk = tv.Disk("table1", friction=law)
    return (
        disk.limit_cycle(tv.reference(f"table1/{law}/limit-cycle/crit-0.5/period").inputs["Omega"])
        if kind == "librating"
        else disk.rotating_cycle("30.6", stable=False)
    )


@pytest.mark.parametrize(
    ("law", "kind"),
    [
        ("linear", "librating"),
        pytest.param("smooth", "librating", marks=_SLOW),
        pytest.param("linear", "rotating", marks=_SLOW),
        pytest.param("smooth", "rotating", marks=_SLOW),
    ],
)
def test_derivatives_obey_the_equations_symmetries(law: str, kind: str) -> None:
    """Only ratios of masses enter. Units of length and time change angles and multipliers not at
    all, periods like a time and v like its inverse.
    """
    cycle = _cycle(law, kind)
    values = {name: getattr(cycle.parameters, name) for name in SYMBOLS}
    values["omega"] = cycle.omega.value

    def scaled(name: str, powers: dict[str, int]) -> tv.Measured:
        row = cycle.sensitivity[name]
        return sum(power * row[symbol] * values[symbol] for symbol, power in powers.items())

    for name in cycle.sensitivity.derivatives:
        power = {"period": 1, "v_0": -1, "v_top": -1}.get(name, 0)
        assert scaled(name, _MASS).holds(0)
        assert scaled(name, _LENGTH).holds(0)
        assert (scaled(name, _TIME) - power * getattr(cycle, name)).holds(0)
        if law == "linear":  # only their ratio enters
            assert scaled(name, {"mu": 1, "epsilon": 1}).holds(0)


def test_those_by_the_speed_are_the_familys() -> None:
    cycle = _cycle("linear", "librating")
    for name in ("period", *cycle.coordinates):
        difference = cycle.sensitivity[name]["omega"] - getattr(cycle, f"d{name}_domega")
        assert difference.holds(0)


@pytest.mark.parametrize("law", ["linear", pytest.param("smooth", marks=_SLOW)])
def test_those_of_the_period_are_the_reference_datas_condition(law: str) -> None:
    cycle = _cycle(law, "librating")
    condition = tv.reference(f"table1/{law}/limit-cycle/crit-0.5/period").condition
    for symbol in SYMBOLS:
        mine = cycle.sensitivity["period"][symbol] * getattr(cycle.parameters, symbol)
        digits = float(condition[symbol])
        # The column has three digits, of differences in doubles with steps of 1e-8: their rounding
        # of some 1e-15 / 1e-8 is below.
        assert float(mine) == pytest.approx(digits, rel=5e-3, abs=1e-6)


@pytest.mark.parametrize("law", ["linear", "smooth"])
@pytest.mark.slow(minutes=1.5)
def test_half_widths_hold_differences_of_forty_digits(law: str) -> None:
    cycle = _cycle(law, "librating")
    step = Fraction(1, 10**12)  # its square is beyond the digits compared, and 40 digits hold it
    for symbol in SYMBOLS:
        value = getattr(cycle.parameters, symbol)
        ahead, behind = (
            tv.Disk("table1", friction=law, **{symbol: value * (1 + sign * step)}).limit_cycle(
                cycle.omega.value, digits=40, half_widths=False
            )
            for sign in (1, -1)
        )
        for name, row in cycle.sensitivity.derivatives.items():
            change = getattr(ahead, name).value - getattr(behind, name).value
            assert row[symbol].holds(change / (2 * step * value)), (symbol, name)


def test_they_are_printed_and_written_in_full() -> None:
    sensitivity = _cycle("linear", "librating").sensitivity
    assert len(str(sensitivity).splitlines()) == 1 + 7 * 9
    assert (
        sensitivity.to_dict()["derivatives"]["period"]["mu"]
        == sensitivity["period"]["mu"].to_dict()
    )


def test_none_next_to_the_connection() -> None:
    cycle = tv.Disk("table1").limit_cycle(above_het="1e-12")
    with pytest.raises(tv.AccuracyError, match=r"Disk\.sensitivity"):
        _ = cycle.sensitivity


# ---------------------------------------------------------------------------- Omega_crit and Omega_h
@pytest.mark.parametrize(
    ("named", "law", "symbols"),
    [
        ("calibrated", "linear", SYMBOLS),
        ("geometry", "smooth", SYMBOLS),
    ],
)
@pytest.mark.slow(minutes=1)
def test_those_of_both_speeds_hold_differences(
    named: str, law: str, symbols: tuple[str, ...]
) -> None:
    # The square of the step, and 27 digits over the step, are beyond the 17 digits compared.
    disk, step = tv.Disk(named, friction=law), Fraction(1, 10**10)
    rows = disk.sensitivity().derivatives
    for symbol in symbols:
        value = getattr(disk, symbol)
        ahead, behind = (
            tv.Disk(named, friction=law, **{symbol: value * (1 + sign * step)}) for sign in (1, -1)
        )
        change = ahead.heteroclinic(digits=27).omega_h - behind.heteroclinic(digits=27).omega_h
        assert rows["omega_h"][symbol].holds(change.value / (2 * step * value)), symbol
        # Omega_crit has fifteen digits, so only its square is compared, which is rational.
        square = (omega_crit_squared(ahead) - omega_crit_squared(behind)) / (2 * step * value)
        difference = 2 * disk.omega_crit * rows["omega_crit"][symbol] - square
        assert abs(difference.value) <= difference.uncertainty + abs(square) * step


def test_a_disk_without_connection_has_those_of_omega_crit_alone() -> None:
    disk = tv.Disk("table1", mu="0.01")
    with pytest.raises(NoConnectionError):
        disk.heteroclinic()
    assert set(disk.sensitivity().derivatives) == {"omega_crit"}
