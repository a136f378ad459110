"""What is made of the half map, and the slips in it: multipliers and derivatives by Omega."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any

import numpy as np

from tippedisk_verify.conformance.diagnosis.entries import Array, Sheet, Table
from tippedisk_verify.conformance.diagnosis.halfmap import RINGS, VARIANTS, Flight
from tippedisk_verify.reference_values.store import stored

__all__ = [
    "Said", "answered", "column", "differences", "flight_of", "instants", "known", "made", "slips", "solve", "variants",
]  # fmt: skip

Said = Iterator[tuple[str, list[Any]]]  #: what is said, and what it predicts of each table; NaN for what is right


def solve(matrix: Array, right: Array) -> Array:
    """Solutions by entry; NaN where there is none."""
    good = np.isfinite(matrix).all(axis=(1, 2)) & (np.linalg.det(np.nan_to_num(matrix)) != 0)
    found = np.linalg.solve(np.where(good[:, None, None], matrix, np.eye(len(right[0]))), right[:, :, None])[:, :, 0]
    return np.asarray(np.where(good[:, None], found, np.nan))


def _radii(P: Array) -> Array:
    """The moduli of the eigenvalues, the larger first."""
    return np.sort(np.abs(np.linalg.eigvals(np.nan_to_num(P))), axis=1).T[::-1]


_ONE = np.eye(2)
Slip = tuple[str, str, Callable[..., Any]]  #: the step, what is said, and what is done there
_RIGHT: dict[str, Callable[..., Any]] = {
    "speed": lambda f: f.flow(f.rows[-1]).T, "dtime": lambda change, speed: -change / speed[:, None],
    "by": lambda speed, dtime: speed[:, :, None] * dtime[:, None], "P": lambda P: P,
    "solve": lambda P, D: solve(_ONE - P, D), "dperiod": lambda parts: parts.sum(axis=1),
    "slow": lambda P, n: _radii(P)[0] ** n, "log": lambda slow, T: np.log(slow),
    "fast": lambda f, whole, log: whole - log,
}  # fmt: skip
_TIME = "the change of the return time"
_SLIPS: list[Slip] = [
    ("speed", "the flow at the return to the section is that of the other friction law",
     lambda f: f.flow(f.rows[-1], not f.smooth).T),
    ("dtime", f"{_TIME} has the wrong sign (as by the v of the start for that of the end)",
     lambda change, speed: change / speed[:, None]),
    ("by", f"{_TIME} is left out of the map's derivative: no projection along the flow",
     lambda s, dt: 0 * s[:, :, None] * dt[:, None]),
    ("by", f"{_TIME} has the wrong sign in the map's derivative", lambda s, dt: -s[:, :, None] * dt[:, None]),
    ("by", f"{_TIME} is left out of the map's derivative by Omega",
     lambda s, dt: s[:, :, None] * dt[:, None] * [1, 1, 0]),
    ("by", f"{_TIME} is left out of the map's derivative by the start",
     lambda s, dt: s[:, :, None] * dt[:, None] * [0, 0, 1]),
    *(("solve", f"the derivatives by Omega {text}", made) for text, made in (
        ("are those of the map at a fixed start: (I - P)^-1 is missing", lambda P, D: D),
        ("solve with I + P in place of I - P", lambda P, D: solve(_ONE + P, D)),
        ("solve with P transposed", lambda P, D: solve(_ONE - P.swapaxes(1, 2), D)),
        ("solve with I - P^2, of the whole map, for the half map's change", lambda P, D: solve(_ONE - P @ P, D)),
        ("solve with P - I: the wrong sign", lambda P, D: solve(P - _ONE, D)),
        ("solve with P in place of I - P", lambda P, D: solve(P, D)),
        ("multiply by I - P in place of solving with it", lambda P, D: ((_ONE - P) @ D[:, :, None])[:, :, 0]))),
    *(("dperiod", f"dperiod_domega: {text}", lambda parts, w=weights: (parts * w).sum(axis=1)) for text, weights in (
        ("the explicit part by Omega is missing", (1, 1, 0)),
        ("the start's change is missing, as at a fixed start", (0, 0, 1)),
        ("the explicit part has the wrong sign", (1, 1, -1)), ("the start's part has the wrong sign", (-1, -1, 1)),
        ("the explicit part is halved", (1, 1, 0.5)), ("the explicit part is doubled", (1, 1, 2)),
        ("the start's part is halved", (0.5, 0.5, 1)), ("the start's part is doubled", (2, 2, 1)),
        ("of half the period", (0.5, 0.5, 0.5)), ("the first component's part is missing", (0, 1, 1)),
        ("v's part is missing", (1, 0, 1)), ("only the first component's part", (1, 0, 0)))),
    *(("log", f"log_multiplier_slow {text}", made) for text, made in (
        ("over half a period: the half map's eigenvalue is not squared", lambda slow, T: np.log(slow) / 2),
        ("per second: divided by the period", lambda slow, T: np.log(slow) / T),
        ("to base 10", lambda slow, T: np.log10(slow)))),
    *(("slow", f"multiplier_slow{text}", made) for text, made in (
        (" over half a period: the half map's eigenvalue is not squared", lambda P, n: _radii(P)[0]),
        (": the half map's eigenvalue is doubled, not squared", lambda P, n: 2 * _radii(P)[0]),
        (" over two periods: squared twice", lambda P, n: _radii(P)[0] ** (2 * n)),
        (": the half map's eigenvalue to the third power", lambda P, n: _radii(P)[0] ** 3),
        (": the smaller eigenvalue for the larger", lambda P, n: _radii(P)[1] ** n),
        *((f": the {text} of the derivative for its eigenvalue", lambda P, n, o=o: np.linalg.norm(P, o, (1, 2)) ** n)
          for text, o in (("norm (singular value)", 2), ("Frobenius norm", "fro"), ("1-norm", 1),
                          ("maximum norm", np.inf))),
        (": the norm (singular value) of the whole map", lambda P, n: np.linalg.norm(P @ P, 2, (1, 2))),
        (": the trace for the eigenvalue", lambda P, n: np.trace(P, axis1=1, axis2=2) ** n),
        (": the determinant for the eigenvalue", lambda P, n: np.linalg.det(P) ** n),
        (": the first diagonal entry for the eigenvalue", lambda P, n: P[:, 0, 0] ** n),
        (": the last diagonal entry for the eigenvalue", lambda P, n: P[:, 1, 1] ** n),
        (": the first diagonal entry of the whole map", lambda P, n: (P @ P)[:, 0, 0]),
        (": the trivial multiplier 1", lambda P, n: 1 + 0 * P[:, 0, 0]))),
    *(("fast", f"log_multiplier_fast: {text}", made) for text, made in (
        ("the divergence is integrated over half a period", lambda f, whole, log: whole / 2 - log),
        ("log_multiplier_slow is not subtracted from the divergence's integral", lambda f, whole, log: whole),
        ("log_multiplier_slow is added, not subtracted", lambda f, whole, log: whole + log),
        ("half of log_multiplier_slow is subtracted", lambda f, whole, log: whole - log / 2),
        ("the divergence's integral is doubled", lambda f, whole, log: 2 * whole - log),
        ("d(v')/dv at the section times the period, not integrated", lambda f, whole, log: f.period * f.slope() - log),
        ("d(v')/dv at the section times the period, not integrated, and no log_multiplier_slow subtracted",
         lambda f, whole, log: f.period * f.slope()),
        ("the divergence is that of the other friction law", lambda f, whole, log: f.divergence(3) - log))),
]  # fmt: skip


def made(f: Flight, variant: int = 0, slot: str = "", use: Any = None) -> dict[str, Array]:
    """The quantities that follow from the half map, with one step done otherwise."""
    do, n = {**_RIGHT, slot: use}, f.ring.parts
    change, speed = f.change(variant), do["speed"](f)
    dtime = do["dtime"](change[:, f.ring.axis], speed[:, f.ring.axis])
    by = f.ring.sign * (change + do["by"](speed, dtime))[:, list(f.ring.kept)]
    P = do["P"](by[:, :, :2])
    slope = do["solve"](P, by[:, :, 2])
    slow = do["slow"](P, n)
    log = do["log"](slow, f.period)
    slopes = (n * do["dperiod"](np.column_stack([dtime[:, :2] * slope, dtime[:, 2]])), *slope.T)
    names = ("dperiod_domega", *(f"d{name}_domega" for name in f.ring.start))
    return dict(zip(names, slopes, strict=True)) | {
        "P": P, "multiplier_slow": slow, "log_multiplier_slow": log,
        "log_multiplier_fast": do["fast"](f, f.divergence(variant), log),
    }  # fmt: skip


def column(table: Table, name: str, values: Array) -> Array:
    """Of answers or truths those of a quantity, by entry."""
    found = np.full(len(table.entries), np.nan)
    for own, row, value in zip(table.names, table.rows, values, strict=True):
        if own == name:
            found[row] = value
    return found


def answered(table: Table, values: Array) -> tuple[Array, Array]:
    """The state on the section and the time of a map, of answers or truths."""
    ring = RINGS[table.kind]
    return np.array([column(table, name, values) for name in ring.start]), column(table, "period", values) / ring.parts


def flight_of(table: Table, start: Array, time: Array, Omega: Array | None = None, variants: int = 1) -> Flight:
    speeds = table.given["Omega"] if Omega is None else Omega
    return Flight(RINGS[table.kind], table.p, speeds, table.smooth, start, time, variants)


_MULTIPLIERS = {"multiplier_slow", "log_multiplier_slow", "log_multiplier_fast"}
_SLOPES = {f"d{name}_domega" for ring in RINGS.values() for name in (*ring.start, "period")}
_ROUND = [m * 10.0**-k for k in range(2, 6) for m in (5.0, 4.0, 2.5, 2.0, 1.0)]
_STEPS = (1e-2, 5e-3, 2e-3, 1e-3, 5e-4, 1e-4, 1e-5, 1e-6)
_LATE = 0.04  # s; what is missed by more is no turning point


def _wrong(sheet: Sheet) -> set[str]:
    return {stem.split(" ")[1] for stem in sheet.stems[sheet.wrong]}


def known(table: Table, name: str) -> Array:
    """Speeds by name, by entry; NaN where they are not known."""
    if name[0] == "3":
        return np.full(len(table.entries), float(name))
    laws = ("linear", "smooth")
    law = laws[table.smooth != ("other law" in name)]
    found = []
    for one in table.sets:
        home = {"printed": "calibrated"}.get(one, "printed") if "another" in name else one
        place = f"{law}/heteroclinic/point/omega_h" if "Omega_h" in name else "linear/hopf/point/omega_crit"
        place = f"{law}/rotation-fold/point/omega" if "fold" in name else place
        known = stored().get(f"{home}/{place}")
        found.append(np.nan if known is None else known.for_doubles)
    return np.array(found)


def _right(sheet: Sheet, variants: int = 1) -> list[Any]:
    """Flights of the right cycles."""
    return [
        flight_of(table, *answered(table, table.truth), variants=variants) if table.kind in RINGS else None
        for table in sheet.tables
    ]


def instants(sheet: Sheet) -> Said:
    """Another instant of the right cycle: of the start, or of beta_max."""
    wrong = _wrong(sheet)
    if not wrong <= {"gamma_bar_0", "v_0", "beta_max"} or any(table.kind == "rotating-cycle" for table in sheet.tables):
        return
    flights = _right(sheet)
    if "beta_max" not in wrong:
        starts = [{"gamma_bar_0": -f.start[0], "v_0": -f.start[1]} for f in flights]
        yield "gamma_bar_0 and v_0 are those where beta = pi/2 is crossed the other way, with v > 0", starts
        return
    at = [np.pi / 2 - f.instant(1, np.pi / 2)[1][0] for f in flights]
    yield "beta_max is taken where gamma = pi/2, not where v = 0", [{"beta_max": one} for one in at]
    turns = [(replace(f, variants=0), *f.instant(2, 0.0)) for f in flights]
    for h in _ROUND:
        for text, chosen in (("before v = 0", np.floor), ("after v = 0", np.ceil), ("nearest to v = 0", np.round)):
            rows = [np.pi / 2 - f.moved(low[:3], chosen(time / h) * h - time)[0] for f, time, low in turns]
            yield f"beta_max is that of the row {text}, in steps of {h:g} s", [{"beta_max": one} for one in rows]
    given = [column(table, "beta_max", table.answer) for table in sheet.tables]
    short = [np.pi / 2 - low[0] - one for (_, _, low), one in zip(turns, given, strict=True)]
    late = [np.sqrt(2 * one / f.flow(low)[2]) for (f, _, low), one in zip(turns, short, strict=True)]
    longest = max(float(np.nanmax(one)) for one in late)
    if np.concatenate(short).min() > -1e-9 and longest < _LATE and sheet.wrong.sum() > 3:
        text = f"beta_max is that of another instant, up to {1e3 * longest:.1g} ms from the turning point"
        yield f"{text}: that is not refined, or wrongly", [{"beta_max": one} for one in given]


def differences(sheet: Sheet) -> Said:
    """Derivatives by Omega or of the half map as finite differences."""
    wrong = _wrong(sheet)
    names = _SLOPES
    if not wrong & names or not wrong <= names | _MULTIPLIERS:
        return
    if wrong <= names:
        yield from _by_digits(sheet, wrong)
        return
    flights = _right(sheet)
    if wrong & _MULTIPLIERS:
        maps: dict[str, list[Any]] = {}
        for f in flights:
            for text, P in _by_start(f) if f else ():
                maps.setdefault(text, []).append(P)
        flown = [f for f in flights if f]
        for text, some in maps.items():
            found = {id(f): made(f, 0, "P", lambda P, Q=Q: Q) for f, Q in zip(flown, some, strict=True)}
            yield text, [f and found[id(f)] for f in flights]


def _by_start(f: Flight) -> Iterator[tuple[str, Array]]:
    """The map's derivative by differences of its images."""
    n, count = f.Omega.size, 4 * len(_STEPS)
    moves = np.array([[k == 0, k == 1] for _ in _STEPS for k in (0, 0, 1, 1)]) * np.repeat(_STEPS, 4)[:, None]
    moves[1::2] *= -1
    start = (f.start[:, None] + moves.T[:, :, None]).reshape(2, -1)
    p = tuple(np.tile(one, count) for one in f.p)
    images = replace(
        f, p=p, Omega=np.tile(f.Omega, count), start=start, time=np.tile(f.time, count), variants=0
    ).image()
    images = np.moveaxis(images.reshape(2, len(_STEPS), 2, 2, n), 4, 0)  # entry, component, step, by, sign
    for k, h in enumerate(_STEPS):
        up, down = images[:, :, k, :, 0], images[:, :, k, :, 1]
        here = f.start.T[:, :, None]
        quotients = {"forward": (up - here) / h, "backward": (here - down) / h, "central": (up - down) / (2 * h)}
        for text, P in quotients.items():
            yield f"the half map's derivative is a {text} difference with a step of {h:g}", P


def _by_digits(sheet: Sheet, wrong: set[str]) -> Said:
    """Quotients of differences: times the step they are whole multiples of what the last digit is worth."""
    values, digits = [], []
    for table in sheet.tables:
        for name in wrong & table.asked:
            base = column(table, name[1:].removesuffix("_domega"), table.truth)
            values.append(column(table, name, table.answer))
            digits.append(np.spacing(np.abs(base)))
    answer, digit = np.concatenate(values), np.concatenate(digits)
    for over in sorted(m * 10.0**-k for k in range(2, 11) for m in (1.0, 2.0, 5.0)):
        whole = answer * over / digit
        told = (np.abs(whole) < 2e14) & (np.abs(whole) > 1e3)
        off = np.abs(whole - np.round(whole))
        if told.sum() > 3 and (off <= np.maximum(1e-3, 4e-16 * np.abs(whole)))[told].all():
            given = [
                {name: column(table, name, table.answer) for name in wrong & table.asked} for table in sheet.tables
            ]
            text = f"one-sided with a step of {over:g} or central with half of it, as the digits tell"
            yield f"{' and '.join(sorted(wrong))}: finite differences in Omega, {text}", given
            return


def slips(sheet: Sheet) -> Said:
    """What is made of the right cycles: the plain map first, then variants of the variational equations."""
    if any(table.wrong[np.isin(table.names, (*RINGS[table.kind].start, "period", "beta_max"))].any()
           for table in sheet.tables if table.kind in RINGS):  # fmt: skip
        return
    flights = _right(sheet)
    for slot, says, use in _SLIPS:
        yield says, [flight and made(flight, 0, slot, use) for flight in flights]
    yield from _lost(sheet, flights)


def variants(sheet: Sheet) -> Said:
    """Other variational equations along the right cycles."""
    wrong = _wrong(sheet)
    if not wrong <= {*_SLOPES, *_MULTIPLIERS} or len(wrong - {"log_multiplier_fast"}) == 1:
        return
    flights = _right(sheet, len(VARIANTS))
    for k, (says, *_) in enumerate(VARIANTS[1:], 1):
        yield says, [flight and made(flight, k) for flight in flights]
    slot, says, use = _SLIPS[-1]
    yield says, [flight and made(flight, 0, slot, use) for flight in flights]


def _lost(sheet: Sheet, flights: list[Any]) -> Said:
    """The smaller eigenvalue, which doubles do not hold."""
    given = [{name: column(table, name, table.answer) for name in table.asked} for table in sheet.tables]
    slow = [one.get("multiplier_slow", np.full(1, np.nan)) for one in given]
    if all((np.abs(one) < 1e-9).all() for one in slow):
        text = "multiplier_slow is tiny: the smaller eigenvalue, or what rounding leaves of it, for the larger"
        pairs = zip(flights, slow, strict=True)
        yield text, [f and made(f, 0, "slow", lambda P, n, s=one: np.abs(s)) for f, one in pairs]
    fast = [one.get("log_multiplier_fast", np.full(1, np.nan)) for one in given]
    parts = [f.ring.parts if f else 1 for f in flights]
    if _wrong(sheet) == {"log_multiplier_fast"} and all(
        ((one < -26 * n) & (one > -46 * n)).all() for one, n in zip(fast, parts, strict=True)
    ):
        text = "log_multiplier_fast is made of the matrix's smaller eigenvalue, which is lost to rounding"
        yield f"{text}, not of the divergence's integral", [{"log_multiplier_fast": one} for one in fast]
