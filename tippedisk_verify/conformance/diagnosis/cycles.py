"""Slips in what is made of a cycle: its multipliers, and the derivatives by Omega.

The half map's pieces are computed once, from the right cycles: the variational equations' solution, its variants, and
the change of the arrival time. A slip puts them together in another way, and predicts the answers for all cycles.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from decimal import Decimal
from typing import Any

import numpy

from tippedisk_verify.conformance.diagnosis.alternatives import Alternative
from tippedisk_verify.conformance.diagnosis.flights import Array
from tippedisk_verify.conformance.diagnosis.predictions import Model
from tippedisk_verify.conformance.diagnosis.shapes import Found, borne_out, shape_of
from tippedisk_verify.conformance.diagnosis.shooting import HalfOrbits, Slip, half_orbits
from tippedisk_verify.conformance.grading import Grade, as_decimal
from tippedisk_verify.reference_values.store import Quantity, Store

__all__ = ["cycle_slip_of", "following_of", "numbers_of", "pieces_of"]

_TINY = 1e-9  # far below all slow multipliers that are asked for
_STATE = ("period", "gamma_bar_0", "v_0")
_DERIVATIVES = ("dperiod_domega", "dgamma_bar_0_domega", "dv_0_domega")
_MULTIPLIERS = ("multiplier_slow", "log_multiplier_slow", "log_multiplier_fast")


def _cut(row: int | slice, column: int, factor: float = 0.0) -> Slip:
    def slip(rows: Array) -> None:
        rows[row, column] *= factor

    return slip


def _transposed(rows: Array) -> None:
    rows[:, :3] = numpy.swapaxes(rows[:, :3].copy(), 0, 1)


#: (the law that they have, what is changed in d(beta', gamma', v') / d(beta, gamma, v, Omega)), by what is said
_VARIANTS: dict[str, tuple[str, Slip | None]] = {
    "": ("", None),
    "the variational equations are those of the linear friction law": ("linear", None),
    "dgamma'/dOmega is missing in the variational equations by Omega": ("", _cut(1, 3)),
    "dv'/dOmega is missing in the variational equations by Omega": ("", _cut(2, 3)),
    "dgamma'/dOmega has the wrong sign in the variational equations by Omega": ("", _cut(1, 3, -1.0)),
    "the explicit parts by Omega are missing in the variational equations": ("", _cut(slice(1, 3), 3)),
    "dgamma'/dbeta is missing in the variational equations": ("", _cut(1, 0)),
    "dgamma'/dbeta has the wrong sign in the variational equations": ("", _cut(1, 0, -1.0)),
    "dv'/dgamma is missing in the variational equations": ("", _cut(2, 1)),
    "the Jacobian of the variational equations is transposed": ("", _transposed),
}
_SOURCES = {
    "dgamma'/dOmega": "dgamma'/dOmega is missing in the variational equations by Omega",
    "dv'/dOmega": "dv'/dOmega is missing in the variational equations by Omega",
}
_PLACES = {"dgamma'/dbeta": (1, 0), "dv'/dbeta": (2, 0), "dv'/dgamma": (2, 1), "dv'/dv": (2, 2)}
_FACTORS = {"is missing": 0.0, "has the wrong sign": -1.0, "is twice as large": 2.0, "is half as large": 0.5}


def _more_variants() -> dict[str, tuple[str, Slip | None]]:
    """Those that are tried where none of the others fits."""
    more = {
        f"{name} {text} in the variational equations": ("", _cut(*place, factor))
        for name, place in _PLACES.items()
        for text, factor in _FACTORS.items()
    }
    more |= {"the matrix of the variational equations is that at the start throughout": ("", _first_kept())}
    return {"": ("", None)} | {text: slip for text, slip in more.items() if text not in _VARIANTS}


def _first_kept() -> Slip:
    kept: list[Array] = []

    def slip(rows: Array) -> None:
        kept.append(rows.copy()) if not kept else None
        rows[:] = kept[0]

    return slip


@dataclass(frozen=True)
class Pieces:
    """Of one cycle: d(state at half the period) / d(gamma_bar_0, v_0, Omega), the rates there, and the divergence."""

    change: Array
    speed: Array
    divergence: float


def _pieces(
    here: Sequence[Quantity], store: Store, variants: Mapping[str, tuple[str, Slip | None]]
) -> dict[str, dict[str, Pieces]]:
    """By variant of the variational equations and by entry; ``here`` has one question of each entry."""
    first = here[0]
    entries = [quantity.id.rsplit("/", 1)[0] for quantity in here]
    period, gamma, v = (numpy.array([store[f"{entry}/{name}"].for_doubles for entry in entries]) for name in _STATE)
    omega = numpy.array([float(quantity.inputs["Omega"]) for quantity in here])
    run = half_orbits(first.set, first.friction, period / 2, gamma, v, omega, list(variants.values()))
    return {text: dict(zip(entries, pieces_of(run, m), strict=True)) for m, text in enumerate(variants)}


def pieces_of(run: HalfOrbits, variant: int = 0) -> list[Pieces]:
    return [
        Pieces(run.change[variant, :, :, n], run.speed[:, n], float(run.divergence[variant, n]))
        for n in range(len(run.omega))
    ]


def _solved(matrix: Array, right: Array) -> Array:
    try:
        return numpy.linalg.solve(matrix, right)
    except numpy.linalg.LinAlgError:
        return numpy.full_like(right, numpy.nan)


_ONE = numpy.eye(2)
_ARRIVAL = "the change of the arrival time has the wrong sign"
_CORRECTED: dict[str, Callable[[Array, Array], Array]] = {
    "": numpy.outer,
    "the change of the arrival time is left out of the half map's derivative": lambda f, dt: 0 * numpy.outer(f, dt),
    f"{_ARRIVAL} in the half map's derivative": lambda f, dt: -numpy.outer(f, dt),
    "the derivative is projected along the section's normal, not along the flow":
        lambda f, dt: numpy.outer([f[0], 0.0, 0.0], dt),
    "the change of the arrival time is left out of the half map's derivative by Omega alone":
        lambda f, dt: numpy.outer(f, dt * [1.0, 1.0, 0.0]),
    "the change of the arrival time is left out of the half map's derivative by gamma alone":
        lambda f, dt: numpy.outer(f, dt * [0.0, 1.0, 1.0]),
    "the change of the arrival time is left out of the half map's derivative by v alone":
        lambda f, dt: numpy.outer(f, dt * [1.0, 0.0, 1.0]),
}  # fmt: skip
_SHIFTED: dict[str, Callable[[Array, Array], Array]] = {
    "": lambda p, by: _solved(_ONE - p, by),
    "the derivatives by Omega are those of the map at a fixed start: (I - P)^-1 is left out": lambda p, by: by,
    "the derivatives by Omega solve with I + P instead of I - P": lambda p, by: _solved(_ONE + p, by),
    "the derivatives by Omega solve with P - I instead of I - P": lambda p, by: _solved(p - _ONE, by),
    "the derivatives by Omega solve with P instead of I - P": _solved,
    "the derivatives by Omega multiply by I - P instead of solving with it": lambda p, by: (_ONE - p) @ by,
    "the derivatives by Omega solve with the transpose of I - P": lambda p, by: _solved(_ONE - p.T, by),
    "the derivatives by Omega solve with I - P^2, of the whole map, for the half map's change":
        lambda p, by: _solved(_ONE - p @ p, by),
    "the derivatives by Omega solve with I - P, the symmetry left out of P alone": lambda p, by: _solved(_ONE + p, -by),
    "the derivatives by Omega take the wrong sign of dP/dOmega": lambda p, by: _solved(_ONE - p, -by),
}  # fmt: skip
_TIMES: dict[str, Callable[[Array, float, Array], Any]] = {
    "": lambda dt, explicit, s: 2 * (dt @ s + explicit),
    "dperiod_domega lacks the explicit part by Omega": lambda dt, explicit, s: 2 * dt @ s,
    "dperiod_domega lacks the start's share, as at a fixed start": lambda dt, explicit, s: 2 * explicit,
    "dperiod_domega has the explicit part by Omega with a wrong sign": lambda dt, explicit, s: 2 * (dt @ s - explicit),
    "dperiod_domega has the explicit part by Omega once, not twice": lambda dt, explicit, s: 2 * dt @ s + explicit,
    "dperiod_domega has the start's share once, not twice": lambda dt, explicit, s: dt @ s + 2 * explicit,
    "dperiod_domega has the wrong sign": lambda dt, explicit, s: -2 * (dt @ s + explicit),
    "dperiod_domega lacks gamma_bar_0's share": lambda dt, explicit, s: 2 * (dt[1] * s[1] + explicit),
    "dperiod_domega lacks v_0's share": lambda dt, explicit, s: 2 * (dt[0] * s[0] + explicit),
}  # fmt: skip
_SIZES: dict[str, Callable[[Array], Any]] = {
    "": lambda p: max(abs(numpy.linalg.eigvals(p))) ** 2,
    "the matrix norm of the half map's derivative, squared, for its radius": lambda p: numpy.linalg.norm(p, 2) ** 2,
    "the Frobenius norm of the half map's derivative, squared, for its radius": lambda p: numpy.linalg.norm(p) ** 2,
    "the maximum norm of the half map's derivative, squared, for its spectral radius":
        lambda p: numpy.linalg.norm(p, numpy.inf) ** 2,
    "the 1-norm of the half map's derivative, squared, for its spectral radius": lambda p: numpy.linalg.norm(p, 1) ** 2,
    "the matrix norm of the whole map's derivative for its spectral radius": lambda p: numpy.linalg.norm(p @ p, 2),
    "the determinant of the half map's derivative for its spectral radius": lambda p: numpy.linalg.det(p) ** 2,
    "the trace of the half map's derivative, squared, for its spectral radius": lambda p: numpy.trace(p) ** 2,
    "the trace of the whole map's derivative for its spectral radius": lambda p: numpy.trace(p @ p),
    "the first entry of the half map's derivative, squared, for its spectral radius": lambda p: p[0, 0] ** 2,
    "the last entry of the half map's derivative, squared, for its spectral radius": lambda p: p[1, 1] ** 2,
    "twice the half map's eigenvalue, not its square": lambda p: 2 * max(abs(numpy.linalg.eigvals(p))),
    "the spectral radius to the fourth power": lambda p: max(abs(numpy.linalg.eigvals(p))) ** 4,
    "the half map's eigenvalue to the third power, not its square": lambda p: max(abs(numpy.linalg.eigvals(p))) ** 3,
    "the half map's eigenvalue, not its square": lambda p: max(abs(numpy.linalg.eigvals(p))),
    "the root of the half map's eigenvalue, not its square": lambda p: max(abs(numpy.linalg.eigvals(p))) ** 0.5,
    "the largest eigenvalue of the half map's derivative made symmetric, squared":
        lambda p: max(abs(numpy.linalg.eigvalsh((p + p.T) / 2))) ** 2,
    "the half map's derivative with the symmetry in gamma alone, not in v":
        lambda p: max(abs(numpy.linalg.eigvals(p * [[1.0], [-1.0]]))) ** 2,
    "the trace less one, for the other multiplier, squared": lambda p: (numpy.trace(p) - 1) ** 2,
    "an eigenvalue of I - P": lambda p: max(abs(numpy.linalg.eigvals(_ONE - p))) ** 2,
    "an eigenvalue of I + P": lambda p: max(abs(numpy.linalg.eigvals(_ONE + p))) ** 2,
}  # fmt: skip


def numbers_of(
    pieces: Pieces, corrected: str = "", shifted: str = "", timed: str = "", sized: str = ""
) -> dict[str, float]:
    """The derivatives by Omega and the multipliers that follow from the half map's pieces, with a slip."""
    dt = -pieces.change[0] / pieces.speed[0]
    by = -(pieces.change + _CORRECTED[corrected](pieces.speed, dt))[1:]
    p, slope = by[:, :2], _SHIFTED[shifted](by[:, :2], by[:, 2])
    slow = float(_SIZES[sized](p))
    log = math.log(slow) if slow > 0 else math.nan
    return {
        "dperiod_domega": float(_TIMES[timed](dt[:2], dt[2], slope)),
        "dgamma_bar_0_domega": float(slope[0]),
        "dv_0_domega": float(slope[1]),
        "multiplier_slow": slow,
        "log_multiplier_slow": log,
        "log_multiplier_fast": 2 * pieces.divergence - log,
    }


Numbers = Mapping[str, Mapping[str, float]]  # by entry and quantity


def _all_of(parts: Mapping[str, Pieces], **slip: str) -> dict[str, dict[str, float]]:
    return {entry: numbers_of(part, **slip) for entry, part in parts.items()}


def _only(made: Numbers, names: Sequence[str]) -> Numbers:
    return {entry: {name: made[entry][name] for name in names} for entry in made}


def _varied(pieces: Mapping[str, Mapping[str, Pieces]]) -> Iterator[tuple[str, Numbers]]:
    """Each variant of the variational equations; the divergence may have been integrated apart from them."""
    for text in filter(None, pieces):
        parts = pieces[text]
        apart = {entry: replace(part, divergence=pieces[""][entry].divergence) for entry, part in parts.items()}
        for made in (_all_of(parts), _all_of(apart)):
            yield text, made
            yield f"{text}, for the derivatives", _only(made, _DERIVATIVES)
            yield f"{text}, for the multipliers", _only(made, _MULTIPLIERS)


def _slips(pieces: Mapping[str, Mapping[str, Pieces]]) -> Iterator[tuple[str, Numbers]]:
    """Each single slip, and what it makes of all entries."""
    right = pieces[""]
    all_of, only = _all_of, _only
    yield from _varied(pieces)
    for text in filter(None, _CORRECTED):
        made = all_of(right, corrected=text)
        yield text, made
        yield f"{text}, for the derivatives", only(made, _DERIVATIVES)
        yield f"{text}, for the multipliers", only(made, _MULTIPLIERS)
    for text in filter(None, _SHIFTED):
        made = all_of(right, shifted=text)
        yield text, made
        yield f"{text}, dperiod_domega apart", only(made, _DERIVATIVES[1:])
        yield f"{text}, in dperiod_domega alone", only(made, _DERIVATIVES[:1])
    yield from ((text, all_of(right, timed=text)) for text in filter(None, _TIMES))
    both = {"corrected": f"{_ARRIVAL} in the half map's derivative", "timed": "dperiod_domega has the wrong sign"}
    yield f"{_ARRIVAL} in the half map's derivative and in dperiod_domega", all_of(right, **both)
    for text in filter(None, _SIZES):
        made = all_of(right, sized=text)
        yield text, made
        yield f"{text}, in multiplier_slow and its logarithm", only(made, _MULTIPLIERS[:2])
        for name in _MULTIPLIERS:
            yield f"{text}, in {name} alone", only(made, (name,))


def _by_other_variables(here: Sequence[Quantity], store: Store) -> Iterator[tuple[str, Numbers]]:
    """Derivatives by the logarithm or a root of the distance from Omega_h or Omega_crit."""
    first = here[0]
    for name, place in (
        ("Omega_h", f"{first.set}/{first.friction}/heteroclinic/point/omega_h"),
        ("Omega_crit", f"{first.set}/linear/hopf/point/omega_crit"),
    ):
        if (origin := store.get(place)) is None:
            continue
        base = Decimal(origin.values["decimals"][0])
        away = {q.id.rsplit("/", 1)[0]: float(Decimal(q.inputs["Omega"]) - base) for q in here}
        for text, factor in (
            (f"by the logarithm of Omega's distance from {name}", lambda d: d),
            (f"by the common logarithm of Omega's distance from {name}", lambda d: d * math.log(10)),
            (f"by the square root of Omega's distance from {name}", lambda d: 2 * math.copysign(abs(d) ** 0.5, d)),
        ):
            for names in (_DERIVATIVES, _DERIVATIVES[:1], _DERIVATIVES[1:]):
                yield (
                    f"{', '.join(names)}: the answers are derivatives {text}",
                    {
                        entry: {name: factor(d) * store[f"{entry}/{name}"].for_doubles for name in names}
                        for entry, d in away.items()
                    },
                )


def _by_divergences(here: Sequence[Quantity], store: Store) -> Iterator[tuple[str, Numbers]]:
    """log_multiplier_fast with the divergence of one state, times the period, for its integral."""
    model = Model(Alternative("", ""), here[0].set, here[0].friction)
    states = {"at the start": None} | {
        f"at {name} spinning": [math.pi / 2, side * math.pi / 2, 0.0]
        for name, side in (("inverted", 1), ("noninverted", -1))
    }
    for text, place in states.items():
        found = {}
        for quantity in here:
            entry = quantity.id.rsplit("/", 1)[0]
            period, gamma, v, log = (store[f"{entry}/{n}"].for_doubles for n in (*_STATE, "log_multiplier_slow"))
            state = place or [math.pi / 2, math.pi / 2 + gamma, v]
            found[entry] = (period * model.jacobian(float(quantity.inputs["Omega"]), state)[1][2], log)
        words = f"log_multiplier_fast: the period times the divergence {text} is taken for the divergence's integral"
        yield words, {entry: {"log_multiplier_fast": whole - log} for entry, (whole, log) in found.items()}
        without = f"{words}, and log_multiplier_slow is not taken off"
        yield without, {entry: {"log_multiplier_fast": whole} for entry, (whole, _) in found.items()}


def _by_sources(
    pieces: Mapping[str, Mapping[str, Pieces]], answers: Mapping[str, Decimal], wrong: set[str]
) -> Iterator[tuple[str, Numbers]]:
    """Another factor on one source of the variational equations by Omega, read off the answer it moves most."""
    right = _only(_all_of(pieces[""]), _DERIVATIVES)
    for name, text in _SOURCES.items():
        without = _all_of(pieces[text])
        shares = {
            f"{entry}/{key}": (right[entry][key] - without[entry][key], right[entry][key])
            for entry in right
            for key in _DERIVATIVES
            if f"{entry}/{key}" in wrong
        }
        if not shares:
            return
        id_ = max(shares, key=lambda id_: abs(shares[id_][0] / shares[id_][1]))
        factor = 1 + (float(answers[id_]) - shares[id_][1]) / shares[id_][0]
        for value in (round(factor, 2), factor):
            yield (
                f"{name} is {value:.6g} times as large in the variational equations by Omega",
                {
                    entry: {key: x + (value - 1) * (x - without[entry][key]) for key, x in numbers.items()}
                    for entry, numbers in right.items()
                },
            )


def _by_shares(
    right: Mapping[str, Pieces], answers: Mapping[str, Decimal], wrong: set[str]
) -> Iterator[tuple[str, Numbers]]:
    """Another factor on one share of dperiod_domega, read off the answer it moves most."""
    shares: dict[str, dict[str, float]] = {}
    for entry, part in right.items():
        dt, slopes = -part.change[0] / part.speed[0], numbers_of(part)
        shares[entry] = {
            "gamma_bar_0's share": 2 * float(dt[0]) * slopes["dgamma_bar_0_domega"],
            "v_0's share": 2 * float(dt[1]) * slopes["dv_0_domega"],
            "the explicit part by Omega": 2 * float(dt[2]),
        }
    entries = [entry for entry in right if f"{entry}/{_DERIVATIVES[0]}" in wrong]
    for name in next(iter(shares.values())) if entries else ():
        entry = max(entries, key=lambda entry: abs(shares[entry][name] / sum(shares[entry].values())))
        given = float(answers[f"{entry}/{_DERIVATIVES[0]}"])
        factor = 1 + (given - sum(shares[entry].values())) / shares[entry][name]
        for value in (round(factor, 2), factor):
            made = {one: {_DERIVATIVES[0]: sum(of.values()) + (value - 1) * of[name]} for one, of in shares.items()}
            yield f"dperiod_domega has {name} {value:.6g} times", made


def cycle_slip_of(usable: Sequence[Grade], wrong: set[str], store: Store) -> Found | None:
    """The one slip that gives the wrong derivatives and multipliers of cycles that are right."""
    answers = {grade.id: as_decimal(grade.answer) for grade in usable}
    asked = [store[grade.id] for grade in usable if store[grade.id].name in (*_DERIVATIVES, *_MULTIPLIERS)]
    if not wrong <= {quantity.id for quantity in asked}:
        return None
    here = list({quantity.id.rsplit("/", 1)[0]: quantity for quantity in asked}.values())

    def fits(made: Numbers) -> bool:
        tried = set()
        for quantity in asked:
            entry, name = quantity.id.rsplit("/", 1)
            expected = made[entry].get(name, quantity.for_doubles)
            if borne_out(answers[quantity.id], expected, quantity, quantity.id in wrong) is None:
                return False
            tried.add(quantity.id)
        return wrong <= tried

    tiny = {id_ for id_ in wrong if id_.endswith("/multiplier_slow") and abs(answers[id_]) < _TINY}
    if tiny and all(quantity.id in tiny for quantity in asked if quantity.name == "multiplier_slow"):
        text = "multiplier_slow: tiny, the fast multiplier or rounding in its place"
        return (("slip", text),), frozenset(tiny)
    found = [text for text, made in _by_other_variables(here, store) if fits(made)]
    found = found or [text for text, made in _by_divergences(here, store) if fits(made)]
    if not found:
        pieces = _pieces(here, store, _VARIANTS)
        made_of: tuple[Callable[[], Iterator[tuple[str, Numbers]]], ...] = (
            lambda: _slips(pieces),
            lambda: _by_sources(pieces, answers, wrong),
            lambda: _by_shares(pieces[""], answers, wrong),
        )
        if len({store[id_].name for id_ in wrong}) > 1:
            made_of += (lambda: _varied(_pieces(here, store, _more_variants())),)
        for several in made_of:
            found = found or [text for text, made in several() if fits(made)]
    return (tuple(("slip", text) for text in found[:1]), frozenset(wrong)) if found else None


def following_of(usable: Sequence[Grade], wrong: set[str], store: Store) -> Found | None:
    """Wrong derivatives of the start by their shape, where dperiod_domega is what follows from them."""
    answers = {grade.id: as_decimal(grade.answer) for grade in usable}
    starts = [grade for grade in usable if store[grade.id].name in _DERIVATIVES[1:]]
    periods = {grade.id for grade in usable if store[grade.id].name == _DERIVATIVES[0]}
    mine = {grade.id for grade in starts} & wrong
    if not (mine and wrong & periods and wrong <= mine | periods):
        return None
    here = list({id_.rsplit("/", 1)[0]: store[id_] for id_ in periods}.values())
    for entry, part in _pieces(here, store, {"": ("", None)})[""].items():
        dt, quantity = -part.change[0] / part.speed[0], store[f"{entry}/{_DERIVATIVES[0]}"]
        if not all(f"{entry}/{name}" in answers for name in _DERIVATIVES):
            return None
        slope = numpy.array([float(answers[f"{entry}/{name}"]) for name in _DERIVATIVES[1:]])
        expected = float(_TIMES[""](dt[:2], dt[2], slope))
        if borne_out(answers[quantity.id], expected, quantity, quantity.id in wrong) is None:
            return None
    found = shape_of(starts, mine, store, by_place=True)
    return found and (
        tuple((name, f"{text}, and dperiod_domega follows from these") for name, text in found[0]),
        found[1] | wrong & periods,
    )
