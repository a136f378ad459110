"""What is wrong near the heteroclinic connection: its speed, the saddle's eigenvalues, and laws that hold near it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from tippedisk_verify.conformance.diagnosis.cycle_slips import Said, column, known
from tippedisk_verify.conformance.diagnosis.entries import Array, Sheet, Table
from tippedisk_verify.conformance.diagnosis.halfmap import RINGS, of

__all__ = ["connections", "near"]

_VALUES = ("lambda_u", "lambda_s", "lambda_ss")
_PLACES = (
    "Omega_h", "Omega_h of the other law", "Omega_crit", "30.07", "30.92", "the fold of the rotating cycles",
    "Omega_h of another set",
)  # fmt: skip


def _eigenvalues(table: Table, Omega: Array, side: int = -1) -> dict[str, Array]:
    good = np.where(np.isfinite(Omega), Omega, 1.0)
    values = of("sorted_eigenvalues")(of("linearisation")(table.p, good, side)).real
    return dict(zip(_VALUES, np.where(np.isfinite(Omega)[:, None], values, np.nan).T, strict=True))


def _grids(table: Table, right: Array) -> dict[str, Array]:
    """Speeds near the right one that a scan or rounding ends at."""
    found = {}
    for k in range(1, 7):
        for step in (m * 10.0**-k for m in (5, 2, 1)):
            for text, done in (("nearest", np.round), ("below", np.floor), ("above", np.ceil)):
                rounds = f" (rounded to {k} decimals)" if step == 10.0**-k and text == "nearest" else ""
                found[f"from a scan with steps of {step:g}, the value {text}{rounds}"] = done(right / step) * step
    return found


def connections(sheet: Sheet) -> Said:
    """Omega_h, and the eigenvalues at it or elsewhere."""
    tables = sheet.tables
    right = [column(table, "omega_h", table.truth) for table in tables]
    right = [np.where(np.isfinite(one), one, known(table, "Omega_h")) for table, one in zip(tables, right, strict=True)]
    answers = [column(table, "omega_h", table.answer) for table in tables]
    named = {name: [known(table, name) for table in tables] for name in _PLACES[1:]}
    grids = [_grids(table, one) for table, one in zip(tables, right, strict=True)]
    named |= {name: [one[name] for one in grids] for name in grids[0]}
    values = [_eigenvalues(table, one) for table, one in zip(tables, right, strict=True)]
    yield from _ends(tables, answers)
    for name, speeds in named.items():
        if name.startswith("from") and sum(len(one) for one in speeds) < 2:
            continue  # a round number may be many things
        there = [_eigenvalues(table, one) for table, one in zip(tables, speeds, strict=True)]
        what = name if name.startswith("from") else f"{name} in its place"
        yield f"omega_h: {what}, with the eigenvalues at that speed", _with(there, speeds)
        yield f"omega_h: {what}, with the right eigenvalues", [{"omega_h": one} for one in speeds]
        yield f"the saddle's eigenvalues are not at Omega_h but {_at(name)}", there
        yield f"omega_h: {what}, with the eigenvalues at the right Omega_h", _with(values, speeds)
    both = [_eigenvalues(table, one, 1) for table, one in zip(tables, right, strict=True)]
    yield "the eigenvalues are those of the other equilibrium, inverted spinning (real parts)", both
    for text, made in _WRITTEN.items():
        yield text, [made(table, one, own) for table, one, own in zip(tables, right, values, strict=True)]
    wrong = np.concatenate([table.wrong & np.isin(table.names, _VALUES) for table in tables])
    if all(np.isfinite(one).all() for one in answers) and wrong.any():
        off = np.concatenate(answers) - np.concatenate(right)
        size = " and ".join(f"{one:+.2g} ({table.friction})" for one, table in zip(off, tables, strict=False))
        there = [_eigenvalues(table, one) for table, one in zip(tables, answers, strict=True)]
        if len(off) > 1 and np.ptp(off) < 1e-7:
            text = (
                "another speed in its place (the fold of the rotating cycles is some 0.04 below), or a shifted result"
            )
            yield (
                f"omega_h is off by {off[0]:+.4g} under both laws, {text}, with the eigenvalues there",
                _with(there, answers),
            )
        text = "the eigenvalues are those at the answered speed, so the search for Omega_h is wrong"
        how = "it ended too early, or its bracket, its start at the saddle or its criterion is coarse or wrong"
        yield f"omega_h is off by {size}, and {text}: {how}", _with(there, answers)
    speeds = [_speed_of(table, one) for table, one in zip(tables, right, strict=True)]
    there = [_eigenvalues(table, one) for table, one in zip(tables, speeds, strict=True)]
    if any(np.abs(one - own).max() > 1e-7 for one, own in zip(speeds, right, strict=True)):
        text = ", ".join(f"{one[0]:.9g} ({table.friction})" for one, table in zip(speeds, tables, strict=True))
        yield f"the saddle's eigenvalues are not at Omega_h but at {text}", there


def _ends(tables: Any, answers: list[Array]) -> Said:
    """One round number for Omega_h."""
    numbers = np.unique(np.round(np.concatenate(answers), 9))
    if numbers.size == 1 and numbers[0] == np.round(numbers[0], 3):
        number = f"{numbers[0]:g}"
        paper = "the published value, or " if number == "30.07" else ""
        text = f"omega_h is {number}, {paper}an end of the interval that is searched: that does not hold Omega_h, or"
        text += " the orbits are judged wrongly (criterion, time, start)"
        there = [_eigenvalues(table, one) for table, one in zip(tables, answers, strict=True)]
        yield f"{text}, with the eigenvalues at that speed", _with(there, answers)


def _at(name: str) -> str:
    return f"at Omega_h {name}" if name.startswith("from") else f"at {name}"


def _with(values: list[dict[str, Array]], speeds: list[Array]) -> list[Any]:
    return [one | {"omega_h": speed} for one, speed in zip(values, speeds, strict=True)]


def _speed_of(table: Table, speed: Array) -> Array:
    """The speed with the answered lambda_u, by Newton's method."""
    wanted = column(table, "lambda_u", table.answer)
    for _ in range(20):
        now, other = (_eigenvalues(table, one)["lambda_u"] for one in (speed, speed + 1e-5))
        speed = speed + np.clip((wanted - now) / (other - now) * 1e-5, -1, 1)
    return speed


def _rolling(table: Table, Omega: Array) -> Array:
    return np.asarray(Omega * np.sqrt(table.p[1] / (table.p[0] - table.p[1])))


_WRITTEN: dict[str, Callable[[Table, Array, dict[str, Array]], dict[str, Array]]] = {
    "lambda_u and lambda_s are +-Omega sqrt(e/(r - e)), of order zero": lambda t, o, v: {
        "lambda_u": _rolling(t, o), "lambda_s": -_rolling(t, o)},
    "lambda_u and lambda_s are +-Omega sqrt(e/r)": lambda t, o, v: {
        "lambda_u": o * np.sqrt(t.p[1] / t.p[0]), "lambda_s": -o * np.sqrt(t.p[1] / t.p[0])},
    "lambda_ss is the trace, d(v')/dv at the saddle": lambda t, o, v: {"lambda_ss": np.sum(list(v.values()), axis=0)},
    "lambda_s is the saddle value, lambda_u + lambda_s": lambda t, o, v: {"lambda_s": v["lambda_u"] + v["lambda_s"]},
    "lambda_u is the saddle value, lambda_u + lambda_s": lambda t, o, v: {"lambda_u": v["lambda_u"] + v["lambda_s"]},
    "lambda_s is the saddle index, lambda_s/lambda_u": lambda t, o, v: {"lambda_s": v["lambda_s"] / v["lambda_u"]},
    "lambda_s is -lambda_u": lambda t, o, v: {"lambda_s": -v["lambda_u"]},
    "lambda_u is -lambda_s": lambda t, o, v: {"lambda_u": -v["lambda_s"]},
    "lambda_u and lambda_ss are interchanged: in ascending order": lambda t, o, v: {
        "lambda_u": v["lambda_ss"], "lambda_ss": v["lambda_u"]},
    "lambda_s and lambda_ss are interchanged": lambda t, o, v: {"lambda_s": v["lambda_ss"], "lambda_ss": v["lambda_s"]},
    "lambda_u and lambda_s are interchanged": lambda t, o, v: {"lambda_s": v["lambda_u"], "lambda_u": v["lambda_s"]},
    "lambda_s and lambda_ss without their sign": lambda t, o, v: {
        "lambda_s": -v["lambda_s"], "lambda_ss": -v["lambda_ss"]},
}  # fmt: skip


def _laws(table: Table, at: Array) -> dict[str, tuple[str, Array]]:
    """Laws that hold near Omega_h: by what is said, the quantity and its values."""
    u, s, ss = _eigenvalues(table, at).values()
    gap = table.given["Omega"] - known(table, "Omega_h")
    period, log = (column(table, name, table.truth) for name in ("period", "log_multiplier_slow"))
    slope = {f"-{k:g}/(lambda_u (Omega - Omega_h))": -k / (u * gap) for k in (2, 1, 4)}
    slope |= {f"{k:g}/(lambda_s (Omega - Omega_h))": k / (s * gap) for k in (2, 1)}
    slow = {
        "-2 (1 + lambda_s/lambda_u) log(Omega - Omega_h)": -2 * (1 + s / u) * np.log(gap),
        "-(1 + lambda_s/lambda_u) log(Omega - Omega_h)": -(1 + s / u) * np.log(gap),
        "(lambda_u + lambda_s) times the period": (u + s) * period, "lambda_s times the period": s * period,
        "(lambda_u + lambda_s) times half the period": (u + s) * period / 2,
    }  # fmt: skip
    trace = "(lambda_u + lambda_s + lambda_ss) times the period"
    fast = {"lambda_ss times the period": ss * period, trace: (u + s + ss) * period,
            f"{trace}, less log_multiplier_slow": (u + s + ss) * period - log,
            "(lambda_ss + lambda_u) times the period": (ss + u) * period}  # fmt: skip
    time = {f"-({k:g}/{name}) log(Omega - Omega_h)": -k / one * np.log(gap) for k in (2, 1) for name, one in
            (("lambda_u", u), ("abs(lambda_s)", -s))}  # fmt: skip
    found = {f"dperiod_domega is the law's leading term {text}": ("dperiod_domega", one) for text, one in slope.items()}
    for name, laws in (("log_multiplier_slow", slow), ("log_multiplier_fast", fast), ("period", time)):
        found |= {f"{name} is the asymptotic {text}": (name, one) for text, one in laws.items()}
    found |= {
        f"multiplier_slow is the asymptotic exp({text})": ("multiplier_slow", np.exp(x)) for text, x in slow.items()
    }
    return found


def near(sheet: Sheet) -> Said:
    """Laws next to Omega_h in place of a cycle's quantities, with a constant that is solved for or without."""
    if sheet.level != 9 or any(table.kind not in RINGS for table in sheet.tables):
        return
    for where in ("at Omega_h", "at the cycle's Omega"):
        speeds = [known(t, "Omega_h") if where == "at Omega_h" else t.given["Omega"] for t in sheet.tables]
        laws = [_laws(table, at) for table, at in zip(sheet.tables, speeds, strict=True)]
        for text, (name, _) in laws[0].items():
            bare, added, constants = [], [], []
            for table, law in zip(sheet.tables, laws, strict=True):
                value, answer = law[text][1], column(table, name, table.answer)
                value = np.where(column(table, name, table.wrong), value, np.nan)
                rest = (answer - value)[np.isfinite(value)]
                constant = float(np.median(rest)) if rest.size else 0.0
                constants.append((table.friction, constant, int(np.isfinite(value).sum())))
                bare.append({name: value})
                added.append({name: value + constant})
            cells = f" (for {sum(count for *_, count in constants)} cycles near Omega_h)"
            yield f"{text}, with the eigenvalues {where}{cells}", bare
            if sum(count for *_, count in constants) >= 3 * len(constants):
                said = ", ".join(f"{constant:+.5g} ({law})" for law, constant, _ in constants)
                yield f"{text} {said}, with the eigenvalues {where}{cells}: its constant is not the cycles'", added
