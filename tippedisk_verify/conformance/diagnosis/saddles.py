"""What is wrong with the heteroclinic connection: its speed, and the saddle's eigenvalues."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from tippedisk_verify.conformance.diagnosis.entries import Array, Results, Sheet, Table
from tippedisk_verify.conformance.diagnosis.specimen import specimen
from tippedisk_verify.reference_values.store import stored

__all__ = ["column", "connections", "known_speeds", "of"]

Said = Iterator[tuple[str, Sequence[Results]]]
_VALUES = ("lambda_u", "lambda_s", "lambda_ss")
_PLACES = ("Omega_h of the other law", "Omega_crit", "30.07", "30.92", "the fold of the rotating cycles")


def of(name: str) -> Any:
    """A function of the client."""
    return specimen().space[name]


def column(table: Table, name: str, values: Array) -> Array:
    """Of answers or truths those of a quantity, by entry."""
    found = np.full(len(table.entries), np.nan)
    here = np.array(table.names) == name
    found[table.rows[here]] = values[here]
    return found


def known_speeds(table: Table, name: str) -> Array:
    """Speeds by name, by entry; NaN where they are not known."""
    if name[0] == "3":
        return np.full(len(table.entries), float(name))
    laws = ("linear", "smooth")
    law = laws[table.smooth != ("other law" in name)]
    place = f"{law}/heteroclinic/point/omega_h" if "Omega_h" in name else "linear/hopf/point/omega_crit"
    place = f"{law}/rotation-fold/point/omega" if "fold" in name else place
    known = [stored().get(f"{one}/{place}") for one in table.sets]
    return np.array([np.nan if one is None else one.for_doubles for one in known])


def _eigenvalues(table: Table, Omega: Array, side: int = -1) -> dict[str, Array]:
    known = np.isfinite(Omega)
    values = of("sorted_eigenvalues")(of("linearisation")(table.p, np.where(known, Omega, 1.0), side)).real
    return dict(zip(_VALUES, np.where(known[:, None], values, np.nan).T, strict=True))


def connections(sheet: Sheet) -> Said:
    """Omega_h, and the eigenvalues at it or elsewhere."""
    tables = sheet.tables
    answers = [column(table, "omega_h", table.answer) for table in tables]
    right = [known_speeds(table, "Omega_h") for table in tables]
    values = [_eigenvalues(table, one) for table, one in zip(tables, right, strict=True)]

    def at(speeds: Sequence[Array]) -> list[dict[str, Array]]:
        """With the eigenvalues at these speeds."""
        pairs = zip(tables, speeds, strict=True)
        return [_eigenvalues(table, one) | {"omega_h": one} for table, one in pairs]

    numbers = np.unique(np.round(np.concatenate(answers), 9))
    if numbers.size == 1 and numbers[0] == np.round(numbers[0], 3):
        paper = "the published value, or " * bool(numbers[0] == 30.07)
        text = f"omega_h is {numbers[0]:g}, {paper}an end of the interval that is searched: that does not hold Omega_h,"
        text += " or the orbits are judged wrongly (criterion, time, start)"
        yield f"{text}, with the eigenvalues at that speed", at(answers)
    named = {f"{name} in its place": [known_speeds(table, name) for table in tables] for name in _PLACES}
    for k in range(1, 7):
        named[f"rounded to {k} decimals, or by a scan with steps of 1e-{k}"] = [np.round(one, k) for one in right]
    for text, speeds in named.items():
        yield f"omega_h: {text}, with the eigenvalues at that speed", at(speeds)
        yield f"omega_h: {text}, with the right eigenvalues", [{"omega_h": one} for one in speeds]
        there = [_eigenvalues(table, one) for table, one in zip(tables, speeds, strict=True)]
        yield f"the saddle's eigenvalues are not at Omega_h but at {text.removesuffix(' in its place')}", there
    both = [_eigenvalues(table, one, 1) for table, one in zip(tables, right, strict=True)]
    yield "the eigenvalues are those of the other equilibrium, inverted spinning (real parts)", both
    trace = [{"lambda_ss": sum(one.values())} for one in values]
    yield "lambda_ss is the trace, d(v')/dv at the saddle", trace
    for name, less in (("e/(r - e)", 1), ("e/r", 0)):
        r_e = [table.p[:2] for table in tables]
        rolling = [one * np.sqrt(e / (r - less * e)) for (r, e), one in zip(r_e, right, strict=True)]
        text = f"lambda_u and lambda_s are +-Omega sqrt({name}), of order zero"
        yield text, [{"lambda_u": one, "lambda_s": -one} for one in rolling]
    if all(np.isfinite(one).all() for one in answers):
        off = np.concatenate(answers) - np.concatenate(right)
        if len(off) > 1 and np.ptp(off) < 1e-7:
            text = "another speed (the fold of the rotating cycles is some 0.04 below), or a shifted result"
            yield f"omega_h is off by {off[0]:+.4g} under both laws: {text}, with the eigenvalues there", at(answers)
        size = " and ".join(f"{one:+.2g} ({table.friction})" for one, table in zip(off, tables, strict=False))
        text = "the eigenvalues are those at the answered speed, so the search for Omega_h is wrong"
        how = "it ended too early, or its bracket, its start at the saddle or its criterion is coarse or wrong"
        yield f"omega_h is off by {size}, and {text}: {how}", at(answers)
