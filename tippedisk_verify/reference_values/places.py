"""Where the questions are put: states, speeds and starts, as decimals.

States come from a Kronecker sequence (Roberts' generalised golden ratio), which fills a box evenly and has no pattern
that a mistake could hide behind. Speeds are rounded to few decimals, so that they can be typed.
"""

from __future__ import annotations

from fractions import Fraction
from functools import lru_cache

from tippedisk_verify.model.exact import exact
from tippedisk_verify.model.measured import Measured
from tippedisk_verify.model.parameters import Friction, Parameters
from tippedisk_verify.reference_values.draws import decimal_text
from tippedisk_verify.reference_values.entries import READINGS, Item, Reading
from tippedisk_verify.theory.hopf import omega_crit

__all__ = [
    "cycles",
    "equilibria",
    "harmonic_balances",
    "heteroclinics",
    "hopfs",
    "near_heteroclinics",
    "rhs",
    "rotation_folds",
    "rotations",
    "slow_manifolds",
    "trajectories",
]

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
#: Rotating cycles: which of the two at a speed, and the speed's distance from Omega_h or Omega_crit. The fold lies some
#: 0.04 below Omega_h for both sets and laws, so that both cycles are there at the speeds below it.
_ROTATIONS = (
    *(("stable", "het", "-0.01"), ("stable", "het", "-0.03"), ("unstable", "het", "-0.01")),
    *(("unstable", "crit", "-0.5"), ("unstable", "crit", "+0.5")),
)
_NEAR_DIGITS = 46  # of the distance from Omega_h
#: pi/2 to fifty digits: what the starts are written with is the input, exactly.
_QUARTER = "1.5707963267948966192313216916397514420985846996876"


def rhs(set_name: str) -> list[Item]:
    """The same 200 states and speeds for every set; a tenth of them close to beta = pi/2."""
    items = []
    for n in range(1, _STATES + 1):
        shares = _kronecker(n, 4)
        width = Fraction(1, 1000) if n % 10 == 0 else Fraction(1)
        beta = Fraction("1.5707") + width * (2 * shares[0] - 1) * Fraction("1.5")
        inputs = {
            "Omega": decimal_text(Fraction(5) + shares[3] * 55 if n % 4 == 0 else 29 + shares[3] * 3, 4),
            "beta": decimal_text(beta, 6),
            "gamma": decimal_text(Fraction("1.5707") + (2 * shares[1] - 1) * Fraction("4.7"), 5),
            "v": decimal_text((2 * shares[2] - 1) * 12, 4),
        }
        items += [Item(f"{set_name}/{law}/rhs/{n:03d}", "rhs", set_name, law, inputs) for law in ("both", *_LAWS)]
    return items


def equilibria(set_name: str) -> list[Item]:
    """Both equilibria at eight speeds."""
    return [
        Item(f"{set_name}/both/equilibrium/{name}-{speed}", "equilibrium", set_name, "both",
             {"Omega": speed, "equilibrium": name})
        for speed in _EQUILIBRIUM_SPEEDS
        for name in ("inverted", "noninverted")
    ]  # fmt: skip


def hopfs(set_name: str) -> list[Item]:
    """The Hopf point."""
    return [Item(f"{set_name}/linear/hopf/point", "hopf", set_name, "linear", {})]


def harmonic_balances(set_name: str) -> list[Item]:
    """The one-harmonic law in both forms, below Omega_crit."""
    return [
        Item(f"{set_name}/linear/harmonic-balance/{form}-crit-{below}", "harmonic-balance", set_name, "linear",
             {"Omega": _below_crit(set_name, below), "form": form})
        for below in _BALANCE_BELOW
        for form in ("printed", "consistent")
    ]  # fmt: skip


def slow_manifolds(set_name: str) -> list[Item]:
    """Orders of the slow manifold at twenty points."""
    from tippedisk_verify.theory.slow_manifold import POINTS

    return [
        Item(f"{set_name}/linear/slow-manifold/{n:02d}", "slow-manifold", set_name, "linear",
             {"Omega": _MANIFOLD_SPEED, "beta": decimal_text(beta, 4), "gamma": decimal_text(gamma, 4)})
        for n, (beta, gamma) in enumerate(POINTS, start=1)
    ]  # fmt: skip


def trajectories(set_name: str) -> list[Item]:
    """The two orbits of each of the six scenes."""
    from tippedisk_verify.motion.scenes import SCENES

    starts = (
        (_QUARTER, f"-{_QUARTER}", "2"),
        (_QUARTER, decimal_text(exact(_QUARTER).rational + Fraction("0.4"), 50), "0"),
    )
    items = []
    for law in _LAWS:
        for scene in SCENES:
            base = _omega_h(set_name, law).value if scene.base == "Omega_h" else _crit(set_name)
            speed = decimal_text(base + scene.offset, 12)
            for n, (beta, gamma, v) in enumerate(starts, start=1):
                inputs = {"Omega": speed, "beta": beta, "gamma": gamma, "v": v}
                items.append(Item(f"{set_name}/{law}/trajectory/{scene.name}{n}", "trajectory", set_name, law, inputs))
    return items


def cycles(set_name: str) -> list[Item]:
    """Limit cycles along the branch, by their distance from Omega_crit."""
    return [
        Item(f"{set_name}/{law}/limit-cycle/crit-{below}", "limit-cycle", set_name, law,
             {"Omega": _below_crit(set_name, below)})
        for law in _LAWS
        for below in _CYCLES_BELOW
    ]  # fmt: skip


def heteroclinics(set_name: str) -> list[Item]:
    """The connection."""
    return [Item(f"{set_name}/{law}/heteroclinic/point", "heteroclinic", set_name, law, {}) for law in _LAWS]


def near_heteroclinics(set_name: str) -> list[Item]:
    """Limit cycles at Omega_h + 10^-k. The speed is written out: doubles can tell it from Omega_h down to k = 8."""
    items = []
    for law in _LAWS:
        omega_h = _omega_h(set_name, law, max(_NEAR) + _NEAR_DIGITS + 4).value
        for k in _NEAR:
            speed = decimal_text(omega_h + Fraction(1, 10**k), k + _NEAR_DIGITS if k > _NEAREST_IN_DOUBLES else 15)
            readings: tuple[Reading, ...] = READINGS if k <= _NEAREST_IN_DOUBLES else ("decimals",)
            name = f"{set_name}/{law}/near-heteroclinic/het+1e-{k}"
            items.append(Item(name, "near-heteroclinic", set_name, law, {"Omega": speed}, readings))
    return items


def rotations(set_name: str) -> list[Item]:
    """Rotating limit cycles: two stable ones, and unstable ones below Omega_h, below Omega_crit and above it."""
    items = []
    for law in _LAWS:
        for form, base, away in _ROTATIONS:
            speed = (_crit(set_name) if base == "crit" else _omega_h(set_name, law).value) + Fraction(away)
            name = f"{set_name}/{law}/rotating-cycle/{form}-{base}{away}"
            items.append(Item(name, "rotating-cycle", set_name, law, {"Omega": decimal_text(speed, 12), "form": form}))
    return items


def rotation_folds(set_name: str) -> list[Item]:
    """The fold of the rotating cycles."""
    return [Item(f"{set_name}/{law}/rotation-fold/point", "rotation-fold", set_name, law, {}) for law in _LAWS]


@lru_cache(maxsize=16)
def _omega_h(set_name: str, law: Friction, digits: int = 14) -> Measured:
    from tippedisk_verify.connection.heteroclinic import heteroclinic
    from tippedisk_verify.flow import default_engine

    return heteroclinic(Parameters.named(set_name).with_friction(law), default_engine(), digits=digits).omega_h


def _crit(set_name: str) -> Fraction:
    return omega_crit(Parameters.named(set_name), 40).value


def _below_crit(set_name: str, below: str) -> str:
    return decimal_text(_crit(set_name) - Fraction(below), 12)


def _kronecker(n: int, dimensions: int) -> list[Fraction]:
    """Fractional parts of n phi^-1, n phi^-2, ... with phi^(d+1) = phi + 1."""
    phi = 2.0
    for _ in range(60):
        phi = (1 + phi) ** (1 / (dimensions + 1))
    return [Fraction(round((0.5 + n * phi ** -(k + 1)) % 1 * 10**6), 10**6) for k in range(dimensions)]
