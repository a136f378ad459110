"""Where wrong answers are, and digits that a method loses: what is said of errors that no changed program makes."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import cache

import numpy as np

from tippedisk_verify.conformance.engine.entries import Array, Sheet
from tippedisk_verify.conformance.grading import Grade
from tippedisk_verify.conformance.sheet import placed
from tippedisk_verify.reference_values.store import Quantity

__all__ = ["conditions", "inputs", "labels", "lost", "names_of", "where"]

_AT_STATES = 5  # the last level whose inputs are those of the formula; an orbit leaves its start's side
_FEW = 4  # answers on either side of a surface, so that the side is no accident
_MOSTLY = 0.9  # of those on one side of a surface are wrong; some may be right by chance
_HALF = 0.5  # of those that a name picks out
_NAMED = 3  # names that are listed
_NUMBERS = ("Omega", "beta", "gamma", "v", "t", "n", "order")
_FUNCTIONS: dict[str, Callable[[Array], Array]] = {"sin": np.sin, "cos": np.cos}
_GROUPS: dict[str, Callable[[str], bool]] = {
    "in derivatives": lambda stem: _slope(stem),
    "in samples in time": lambda stem: stem in ("beta", "gamma", "v"),
    "in crossings": lambda stem: stem.startswith("crossing_"),
    "in residuals": lambda stem: stem.startswith("residual_"),
    "in imaginary parts": lambda stem: stem.endswith("_im"),
    "in real parts": lambda stem: stem.endswith("_re"),
    "in multipliers": lambda stem: "multiplier" in stem,
}


@cache
def _place(name: str) -> dict[str, float]:
    return {key: float(text) for key, text in placed(name)[1].items()}


def _slope(stem: str) -> bool:
    return stem.startswith("d") or stem in ("transversality", "period_slope", "amplitude_squared_slope", "null_vector")


def names_of(sheet: Sheet) -> Array:
    """The quantity that each answer is to, without its place and law."""
    return np.concatenate([table.stems for table in sheet.tables])


def inputs(sheet: Sheet) -> dict[str, Array]:
    """The numbers that each answer's question has beside the parameters; NaN for what it has not."""
    found = {}
    for name in _NUMBERS:
        parts = []
        for table in sheet.tables:
            if name in table.given:
                parts.append(table.given[name][table.rows])
            else:
                parts.append(np.array([_place(one).get(name, np.nan) for one in table.names]))
        found[name] = np.concatenate(parts)
    return found


def labels(sheet: Sheet) -> dict[str, Array]:
    """The names that each answer's question has."""
    columns: dict[str, list[Array]] = {}
    for table in sheet.tables:
        entries = np.array(["/".join(entry.id.split("/")[2:]) for entry in table.entries])
        laws = np.array([table.friction] * len(table.entries))
        known = {"law": laws, "equilibrium": table.given["equilibrium"], "form": table.given["form"]}
        for name, values in {**known, "parameter set": table.sets, "entry": entries}.items():
            columns.setdefault(name, []).append(values[table.rows])
    return {name: np.concatenate(parts) for name, parts in columns.items()}


def conditions(sheet: Sheet) -> Iterator[tuple[str, Array]]:
    """Conditions on a question that a branch of a program may have, and which answers are to such questions."""
    for name, values in labels(sheet).items():
        picked = np.unique(values[sheet.wrong])
        if 0 < len(picked) <= _NAMED and (values != picked[0]).any():
            yield (
                f"for {' and '.join(picked)}" if name != "entry" else f"for {_listed('entry', picked)}",
                np.isin(values, picked),
            )
    for text, value in _signed(sheet):
        yield f"where {text} > 0", value > 0
        yield f"where {text} < 0", value < 0
    for name, value in inputs(sheet).items():
        bad = value[sheet.wrong]
        if np.isfinite(bad).all() and len(bad) and np.nanmin(value) < np.nanmax(value):
            yield f"from {name} = {bad.min():.6g} on", value >= bad.min()
            yield f"up to {name} = {bad.max():.6g}", value <= bad.max()


def _listed(name: str, picked: Array) -> str:
    plain = [str(text).rsplit("/", 1)[-1] for text in picked]
    return f"the {name} {plain[0]}" if len(plain) == 1 else f"the {name[:-1]}ies {', '.join(plain)}"


def _signed(sheet: Sheet) -> Iterator[tuple[str, Array]]:
    yield "the right value", sheet.truth
    if sheet.level > _AT_STATES:
        return
    numbers = inputs(sheet)
    for name in ("beta", "gamma"):
        for function, of in _FUNCTIONS.items():
            yield f"{function}({name})", of(numbers[name])
    yield "v", numbers["v"]
    p = np.concatenate([np.array(table.p)[:, table.rows] for table in sheet.tables], axis=1)
    Omega, beta, gamma, v = (numbers[name] for name in ("Omega", "beta", "gamma", "v"))
    r, e, m, _, B, g = p[:6]
    sliding = (r + e * np.sin(gamma)) * v * np.sin(beta) - e * Omega * np.sin(beta) ** 2 * np.cos(gamma)
    yield "gamma_y", sliding
    yield "Omega - Omega_crit", Omega - (r + e) * np.sqrt(m * g / (r * (B - m * e**2)))


def where(sheet: Sheet) -> str:
    """The simplest condition that all wrong answers satisfy and others to the same quantities do not; else nothing."""
    if not sheet.wrong.any():
        return ""
    stems = names_of(sheet)
    failing = np.unique(stems[sheet.wrong])
    same = np.isin(stems, failing)
    said = [text for text in [_only(failing, np.unique(stems[~same]))] if text and not same.all()]
    for text, mask in conditions(sheet):
        inside, outside = mask & same, ~mask & same
        if not outside.any() or (sheet.wrong & ~mask).any():
            continue
        share = float(sheet.wrong[inside].mean())
        named = text.startswith("for ")
        if share > (_HALF if named else _MOSTLY) and (named or min(inside.sum(), outside.sum()) >= _FEW):
            said.append(text if said else f"only {text}")
            break
    return " ".join(said)


def _only(failing: Array, passing: Array) -> str:
    for text, holds in _GROUPS.items():
        if len(failing) > 1 and all(map(holds, failing)) and not any(map(holds, passing)):
            return f"only {text}"
    return f"only in {' and '.join(failing)}" if len(failing) <= _NAMED else ""


# ------------------------------------------------------------------------------------------ lost digits
_SINGLE, _EPS = 2.0**-24, 2.0**-52
_NEARLY = (1e-13, 1e-3)  # medians of relative errors that are lost digits
_WORST = 0.03  # the largest one
_BOTH = 0.15  # at least so many errors are of the rarer sign
_SMOOTH = 0.15  # of the errors are left where slightly other inputs explain them
_CRUDE = 0.005  # s; a step that brings the samples in time out right is no longer
_INTEGRATED = 1.5e-4  # as a change of all inputs; SciPy's methods stay below at tolerances up to 1e-4
_STEPS = {f"{first}e-{n}": float(f"{first}e-{n}") for n in range(3, 15) for first in (1, 2, 5)}
_STEPS |= {"the square root of eps": _EPS**0.5, "the cube root of eps": _EPS ** (1 / 3)}
_MULTIPLES = (32, 1e11)  # smaller ones tell less of a step, larger ones are lost in the quotient's rounding
_WHOLE = 0.02  # how far from a whole multiple, for a chance of 0.04 each
_ENOUGH = 12  # answers that bear it out: 0.04^12 against some forty steps
_FAST = "log_multiplier_fast"


def lost(sheet: Sheet) -> tuple[str, Array] | None:
    """What method loses the digits that are missing, and the answers that this is said of."""
    looks = (_in_slopes, _in_single, _in_the_fast_multiplier, _at_crossings, _on_the_way)
    return next((found for look in looks if (found := look(sheet)) is not None), None) if sheet.wrong.any() else None


def _asked(sheet: Sheet) -> list[tuple[Quantity, Grade]]:
    """The question and the grade of each answer."""
    asked = []
    for table in sheet.tables:
        known = [
            {q.name: (q, grade) for q, grade in zip(entry.quantities, entry.grades, strict=True)}
            for entry in table.entries
        ]
        asked += [known[row][name] for name, row in zip(table.names, table.rows.tolist(), strict=True)]
    return asked


def _relative(sheet: Sheet) -> Array:
    """Errors with their signs, by the size that they are graded against."""
    needs = np.array([grade.needs for _, grade in _asked(sheet)])
    return np.asarray((sheet.answer - sheet.truth) / (sheet.allowed * 10.0**needs))


def _small(errors: Array) -> bool:
    """Whether errors are lost digits: small ones of both signs."""
    sizes = np.abs(errors)
    if len(errors) < _FEW or not _NEARLY[0] < np.median(sizes) < _NEARLY[1] or sizes.max() > _WORST:
        return False
    return bool(_BOTH < np.mean(errors > 0) < 1 - _BOTH)


def _in_slopes(sheet: Sheet) -> tuple[str, Array] | None:
    """Derivatives that are differences: their rounding tells the step, or all of them are off a little."""
    stems = names_of(sheet)
    slopes = np.isin(stems, [stem for stem in np.unique(stems) if _slope(stem)])
    mine, errors = sheet.wrong & slopes, _relative(sheet)
    if not mine.any() or not np.median(np.abs(errors[mine])) < _WORST:
        return None
    if (step := _step(sheet, mine)) is not None:
        return f"errors of a difference quotient with a step of {step}, in the derivatives only", mine
    others = np.abs(errors[sheet.wrong & ~slopes])
    alone = slopes.any() and not slopes.all() and not (len(others) and np.median(others) < _NEARLY[1])
    if not alone or len(np.unique(stems[mine])) < 2 or not _small(errors[mine]):
        return None
    more = ", or of a tolerance or step too coarse for the variational equations" if sheet.level > _AT_STATES else ""
    return f"errors of the size of a difference quotient, in the derivatives only{more}", mine


def _step(sheet: Sheet, mine: Array) -> str | None:
    """The step whose quotients the answers are: whole multiples of the last unit of v' over it."""
    entries = [grade.id.rsplit("/", 1)[0] for _, grade in _asked(sheet)]
    values = {key: x for key, name, x in zip(entries, names_of(sheet), sheet.truth, strict=True) if name == "v_rate"}
    units = np.spacing(np.abs([values.get(key, np.nan) for key, one in zip(entries, mine, strict=True) if one]))
    for text, step in sorted(_STEPS.items(), key=lambda one: one[1]):  # what holds for a step holds for its multiples
        multiples = np.abs(sheet.answer[mine] / units * step)
        multiples = multiples[(multiples > _MULTIPLES[0]) & (multiples < _MULTIPLES[1])]
        off = np.abs(multiples - np.round(multiples))
        if len(multiples) >= _ENOUGH and (off < _WHOLE).mean() >= _MOSTLY:
            return f"{text} (forward, or twice a central one's)"
    return None


def _in_single(sheet: Sheet) -> tuple[str, Array] | None:
    sizes = np.abs(_relative(sheet))
    if sheet.level > _AT_STATES or sheet.wrong.sum() < _FEW or sizes.max() > 64 * _SINGLE:
        return None
    return ("errors of the size of single precision", sheet.wrong) if np.median(sizes) > _SINGLE / 64 else None


def _in_the_fast_multiplier(sheet: Sheet) -> tuple[str, Array] | None:
    """An eigenvalue below 1e-16 of the largest is rounding, about the same whatever its right value."""
    mine = sheet.wrong & (names_of(sheet) == _FAST)
    answer, truth = sheet.answer[mine], sheet.truth[mine]
    rounding = (answer > -75) & (answer < -20) & (truth < -50) & (answer > truth + 10)
    if not mine.any() or not rounding.all() or np.ptp(answer) > 16:
        return None
    return f"{_FAST} is what rounding leaves of an eigenvalue: integrate the divergence", mine


def _at_crossings(sheet: Sheet) -> tuple[str, Array] | None:
    """Events located at steps or on straight lines, where samples in time are right."""
    stems = names_of(sheet)
    samples, times = np.isin(stems, ("beta", "gamma", "v")), np.isin(stems, ("crossing_time", "flat_time"))
    events = sheet.wrong & ~samples
    if sheet.level != 6 or not samples.any() or (sheet.wrong & samples).any() or events.sum() < _FEW:
        return None
    if not times.any() or np.abs(sheet.answer - sheet.truth)[times].max() > _CRUDE:
        return None
    if (events & times).any():
        return "crossings are located crudely, in steps or on straight lines: samples in time are right", events
    return "crossings have the state of another instant than their time, which is right", events


def _on_the_way(sheet: Sheet) -> tuple[str, Array] | None:
    """An integrator's errors: of all directions, where slightly other inputs would make the same ones everywhere."""
    if sheet.level not in (6, 7, 9, 10) or sheet.wrong.sum() < _FEW:
        return None
    conditions = [quantity.condition for quantity, _ in _asked(sheet)]
    symbols = sorted(set[str]().union(*conditions))
    slopes = np.array([[float(one.get(symbol, 0)) for symbol in symbols] for one in conditions])
    weights = 1 / np.maximum(np.abs(slopes).sum(axis=1), 1e-300)
    errors, slopes = (sheet.answer - sheet.truth) * weights, slopes * weights[:, None]
    if len(errors) < 3 * len(symbols) or not np.abs(errors).max() < _INTEGRATED or not _small(errors[sheet.wrong]):
        return None
    left = errors - slopes @ np.linalg.lstsq(slopes, errors, rcond=1e-6)[0]
    if np.linalg.norm(left) < _SMOOTH * np.linalg.norm(errors):
        return None
    return "errors of the size of an integrator's: a loose tolerance, too long a step, or single precision", sheet.wrong
