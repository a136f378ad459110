"""The rules for the inputs of the published questions, as in the data's README.

States come from a Kronecker sequence (Roberts' generalised golden ratio), which fills a box evenly
and has no pattern that a mistake could hide behind. Speeds are rounded to few decimals, so that
they can be typed.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from fractions import Fraction
from functools import lru_cache

from tippedisk_verify import SCENES, Disk, Measured, exact, omega_crit
from tippedisk_verify.model.parameters import Friction
from tippedisk_verify.reference_values.drawn_disks import decimal_text
from tippedisk_verify.reference_values.entries import READINGS, ReferenceEntry
from tippedisk_verify.theory.slow_manifold import RESIDUAL_POINTS

_LAWS: tuple[Friction, ...] = ("linear", "smooth")

_STATES = 200
_EQUILIBRIUM_SPEEDS = ("5", "25", "29.9", "30.0488682607225", "30.4", "30.8", "31.4", "60")
_BALANCE_BELOW = ("0.0001", "0.01", "0.1", "0.5")
_MANIFOLD_SPEED = "30.4"
_CYCLES_BELOW = ("0.01", "0.05", "0.1", "0.2", "0.3", "0.4", "0.5", "0.6", "0.7")
#: Limit cycles are asked for at Omega_h + 10^-k for these k.
_NEAR = (1, 2, 3, 4, 5, 6, 8, 10, 12, 16, 20, 30)
# Beyond, an ulp of Omega in double is more than a millionth of the distance from Omega_h.
_NEAREST_IN_DOUBLES = 8
_NEAR_DIGITS = 46  # of the distance from Omega_h
#: Rotating cycles: which of the two at a speed, and the speed's distance from Omega_h or
#: Omega_crit. The fold lies some 0.04 below Omega_h for both sets and laws, so that both cycles are
#: there at the speeds below it.
_ROTATIONS = (
    *(("stable", "het", "-0.01"), ("stable", "het", "-0.03"), ("unstable", "het", "-0.01")),
    *(("unstable", "crit", "-0.5"), ("unstable", "crit", "+0.5")),
)
#: pi/2 to fifty digits: what the starts are written with is the input, exactly.
_QUARTER = "1.5707963267948966192313216916397514420985846996876"


def _rhs(name: str) -> Iterator[ReferenceEntry]:
    """Return 200 states and speeds, the same for every set; a tenth are close to beta = pi/2."""
    for n in range(1, _STATES + 1):
        shares = _kronecker(n, 4)
        width = Fraction(1, 1000) if n % 10 == 0 else Fraction(1)
        beta = Fraction("1.5707") + width * (2 * shares[0] - 1) * Fraction("1.5")
        inputs = {
            "Omega": decimal_text(
                Fraction(5) + shares[3] * 55 if n % 4 == 0 else 29 + shares[3] * 3, 4
            ),
            "beta": decimal_text(beta, 6),
            "gamma": decimal_text(Fraction("1.5707") + (2 * shares[1] - 1) * Fraction("4.7"), 5),
            "v": decimal_text((2 * shares[2] - 1) * 12, 4),
        }
        for law in ("both", *_LAWS):
            yield ReferenceEntry(f"{name}/{law}/rhs/{n:03d}", inputs)


def _equilibria(name: str) -> Iterator[ReferenceEntry]:
    for speed in _EQUILIBRIUM_SPEEDS:
        for state in ("inverted", "noninverted"):
            yield ReferenceEntry(
                f"{name}/both/equilibrium/{state}-{speed}", {"Omega": speed, "equilibrium": state}
            )


def _harmonic_balances(name: str) -> Iterator[ReferenceEntry]:
    for below in _BALANCE_BELOW:
        for form in ("printed", "consistent"):
            inputs = {"Omega": _below_crit(name, below), "form": form}
            yield ReferenceEntry(f"{name}/linear/harmonic-balance/{form}-crit-{below}", inputs)


def _slow_manifolds(name: str) -> Iterator[ReferenceEntry]:
    for n, (beta, gamma) in enumerate(RESIDUAL_POINTS, start=1):
        inputs = {
            "Omega": _MANIFOLD_SPEED,
            "beta": decimal_text(beta, 4),
            "gamma": decimal_text(gamma, 4),
        }
        yield ReferenceEntry(f"{name}/linear/slow-manifold/{n:02d}", inputs)


def _trajectories(name: str) -> Iterator[ReferenceEntry]:
    """Return the two orbits of each of the six scenes."""
    starts = (
        (_QUARTER, f"-{_QUARTER}", "2"),
        (_QUARTER, decimal_text(exact(_QUARTER).rational + Fraction("0.4"), 50), "0"),
    )
    for law in _LAWS:
        for scene in SCENES:
            base = _omega_h(name, law).value if scene.base == "Omega_h" else _crit(name)
            for n, start in enumerate(starts, start=1):
                inputs = dict(zip(("beta", "gamma", "v"), start, strict=True))
                inputs = {"Omega": decimal_text(base + scene.offset, 12), **inputs}
                yield ReferenceEntry(f"{name}/{law}/trajectory/{scene.name}{n}", inputs)


def _cycles(name: str) -> Iterator[ReferenceEntry]:
    for law in _LAWS:
        for below in _CYCLES_BELOW:
            yield ReferenceEntry(
                f"{name}/{law}/limit-cycle/crit-{below}", {"Omega": _below_crit(name, below)}
            )


def _near_heteroclinics(name: str) -> Iterator[ReferenceEntry]:
    """Return limit cycles at Omega_h + 10^-k.

    The speed is written in full; doubles can distinguish it from Omega_h down to k = 8.
    """
    for law in _LAWS:
        omega_h = _omega_h(name, law, max(_NEAR) + _NEAR_DIGITS + 4).value
        for k in _NEAR:
            in_doubles = k <= _NEAREST_IN_DOUBLES
            speed = decimal_text(
                omega_h + Fraction(1, 10**k), 15 if in_doubles else k + _NEAR_DIGITS
            )
            readings = READINGS if in_doubles else READINGS[:1]
            yield ReferenceEntry(
                f"{name}/{law}/near-heteroclinic/het+1e-{k}", {"Omega": speed}, readings
            )


def _rotations(name: str) -> Iterator[ReferenceEntry]:
    """Return two stable cycles, and unstable ones below Omega_h, below Omega_crit and above it."""
    for law in _LAWS:
        for form, base, away in _ROTATIONS:
            speed = (_crit(name) if base == "crit" else _omega_h(name, law).value) + Fraction(away)
            inputs = {"Omega": decimal_text(speed, 12), "form": form}
            yield ReferenceEntry(f"{name}/{law}/rotating-cycle/{form}-{base}{away}", inputs)


def _points(kind: str, *laws: str) -> Callable[[str], Iterator[ReferenceEntry]]:
    """Return the questions that need only the disk."""
    return lambda name: (ReferenceEntry(f"{name}/{law}/{kind}/point", {}) for law in laws)


#: All questions of a kind for a parameter set; kinds in order of difficulty.
PLACES: dict[str, Callable[[str], Iterator[ReferenceEntry]]] = {
    "rhs": _rhs,
    "equilibrium": _equilibria,
    "hopf": _points("hopf", "linear"),
    "harmonic-balance": _harmonic_balances,
    "slow-manifold": _slow_manifolds,
    "trajectory": _trajectories,
    "limit-cycle": _cycles,
    "heteroclinic": _points("heteroclinic", *_LAWS),
    "near-heteroclinic": _near_heteroclinics,
    "rotating-cycle": _rotations,
    "rotation-fold": _points("rotation-fold", *_LAWS),
}


@lru_cache(maxsize=16)
def _omega_h(name: str, law: Friction, digits: int = 14) -> Measured:
    return Disk(name, friction=law).heteroclinic(digits=digits).omega_h


def _crit(name: str) -> Fraction:
    return omega_crit(Disk(name), 40).value


def _below_crit(name: str, below: str) -> str:
    return decimal_text(_crit(name) - Fraction(below), 12)


def _kronecker(n: int, dimensions: int) -> list[Fraction]:
    """Return the fractional parts of n phi^-1, n phi^-2, ... with phi^(d+1) = phi + 1."""
    phi = 2.0
    for _ in range(60):
        phi = (1 + phi) ** (1 / (dimensions + 1))
    return [
        Fraction(round((0.5 + n * phi ** -(k + 1)) % 1 * 10**6), 10**6) for k in range(dimensions)
    ]
