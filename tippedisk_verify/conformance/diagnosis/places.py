"""Where wrong answers are, and digits that a method loses: what is said of errors that no changed program makes."""

from __future__ import annotations

import re
from collections.abc import Iterator
from functools import cache
from itertools import product

import numpy as np

from tippedisk_verify.conformance.diagnosis.entries import Array, Sheet
from tippedisk_verify.conformance.sheet import placed
from tippedisk_verify.model.parameters import SYMBOLS

__all__ = ["conditions", "inputs", "labels", "lost", "names_of", "parameters", "where"]

_FEW = 4  # answers on either side of a surface, so that the side is no accident
_SHARE = {True: 0.5, False: 0.9}  # of those that a name, or a surface, picks out are wrong; some may be so by chance
_NAMED = 3  # names that are listed
_ADJECTIVES = ("law", "equilibrium", "form")
_NUMBERS = ("Omega", "beta", "gamma", "v", "t", "n", "order")
_SLOPES = ("d", "transversality", "amplitude_squared_slope", "period_slope", "null_vector")
_GROUPS = {
    "derivatives": lambda stem: stem.startswith(_SLOPES), "crossings": lambda stem: stem.startswith("crossing_"),
    "samples in time": lambda stem: stem in ("beta", "gamma", "v"), "residuals": lambda stem: stem.startswith("resid"),
    "imaginary parts": lambda stem: stem.endswith("_im"), "multipliers": lambda stem: "multiplier" in stem,
}  # fmt: skip


def names_of(sheet: Sheet) -> Array:
    """The quantity that each answer is to, without its place and law."""
    return np.concatenate([table.stems for table in sheet.tables])


@cache
def _place(name: str, key: str) -> float:
    return float(placed(name)[1].get(key, "nan"))


def inputs(sheet: Sheet) -> dict[str, Array]:
    """The numbers that each answer's question has beside the parameters; NaN for what it has not."""
    found: dict[str, list[float]] = {key: [] for key in _NUMBERS}
    for key, table in product(_NUMBERS, sheet.tables):
        known = table.given.get(key)
        found[key] += [_place(name, key) for name in table.names] if known is None else known[table.rows].tolist()
    return {key: np.array(values) for key, values in found.items()}


def parameters(sheet: Sheet) -> dict[str, Array]:
    """The parameters of each answer's question."""
    values = np.concatenate([np.array(table.p)[:, table.rows] for table in sheet.tables], axis=1)
    return dict(zip(SYMBOLS, values, strict=True))


def labels(sheet: Sheet) -> dict[str, Array]:
    """The names that each answer's question has; an entry goes by its kind and name."""
    columns: dict[str, list[Array]] = {}
    for table in sheet.tables:
        entries = np.array([entry.id.split("/", 2)[2] for entry in table.entries])
        known = {"law": np.full(len(entries), table.friction), "equilibrium": table.given["equilibrium"]}
        known |= {"form": table.given["form"], "parameter set": table.sets, "entry": entries}
        for name, values in known.items():
            columns.setdefault(name, []).append(values[table.rows])
    return {name: np.concatenate(parts) for name, parts in columns.items()}


def conditions(sheet: Sheet) -> Iterator[tuple[str, Array]]:
    """Conditions on a question that wrong answers satisfy, and which answers are to such questions."""
    for name, values in labels(sheet).items():
        picked = np.unique(values[sheet.wrong])
        text = " and ".join(str(one).rsplit("/", 1)[-1] for one in picked)
        if len(picked) <= _NAMED and not np.isin(values, picked).all():
            text = f"{text} {name}" if name in _ADJECTIVES else f"{name} {text}"
            yield f"for the {text}", np.isin(values, picked)
    for name, value in inputs(sheet).items():
        bad = value[sheet.wrong]
        if np.isfinite(bad).all():
            yield f"from {name} = {bad.min():.6g} on", value >= bad.min()
            yield f"up to {name} = {bad.max():.6g}", value <= bad.max()


def where(sheet: Sheet) -> str:
    """The simplest condition that all wrong answers satisfy and others to the same quantities do not; else nothing."""
    if not sheet.wrong.any():
        return ""
    stems = names_of(sheet)
    failing = np.unique(stems[sheet.wrong])
    same = np.isin(stems, failing)
    said = [f"in {text}" for text, holds in _GROUPS.items() if [*map(holds, stems)] == same.tolist()][:1]
    if not same.all() and (len(failing) == 1 or not said):
        said = [f"in {' and '.join(failing)}"] if len(failing) <= _NAMED else []
    for text, mask in conditions(sheet):
        inside, outside, named = mask & same, ~mask & same, text.startswith("for ")
        if not outside.any() or (sheet.wrong & ~mask).any() or sheet.wrong[inside].mean() < _SHARE[named]:
            continue
        if named or min(inside.sum(), outside.sum()) >= _FEW:
            said.append(text)
            break
    return f"only {' '.join(said)}" if said else ""


# ------------------------------------------------------------------------------------------ lost digits
_EPS = 2.0**-52
_STEPS = {f"{first}e-{n}": float(f"{first}e-{n}") for n in range(14, 2, -1) for first in (1, 2, 5)}
_STEPS |= {"the square root of eps": _EPS**0.5, "the cube root of eps": _EPS ** (1 / 3)}
_MULTIPLES = (32, 1e11)  # smaller ones tell less of a step, larger ones are lost in the quotient's rounding
_WHOLE = 0.02  # how far from a whole multiple, for a chance of 0.04 each
_ENOUGH = 12  # answers that bear it out: 0.04^12 against some forty steps


@np.errstate(all="ignore")
def lost(sheet: Sheet) -> tuple[str, Array] | None:
    """Derivatives that are differences, whose rounding tells the step; with the answers that this is said of."""
    stems = names_of(sheet)
    mine = sheet.wrong & (np.char.startswith(stems, "d") | np.isin(stems, _SLOPES))
    answers = sheet.answer[mine]
    # Whole numbers, zero among them, and those of single precision are multiples of too much.
    if not mine.any() or (answers == np.round(answers)).any() or (answers == answers.astype("f4")).any():
        return None
    entries = [id_.rsplit("/", 1)[0] for id_ in sheet.ids]
    values = dict(zip(zip(entries, stems, strict=True), sheet.truth, strict=True))
    parts = [re.fullmatch(r"d(\w+?)_d(\w+)", stem) or ("", stem, "") for stem in stems]
    # The difference of two doubles is a whole multiple of their last unit, and the answer one of that over the step.
    units = np.spacing(np.abs([values.get((entry, one[1]), np.nan) for entry, one in zip(entries, parts, strict=True)]))
    given, columns = inputs(sheet), [one[2].replace("omega", "Omega") for one in parts]
    x = np.array([given[name][n] if name in given else np.nan for n, name in enumerate(columns)])[mine]
    for text, step in sorted(_STEPS.items(), key=lambda one: one[1]):  # what holds for a step holds for its multiples
        ways = {"forward, or twice a central one's": step, "forward": x + step - x, "central": x + step - (x - step)}
        for how, taken in ways.items():  # the step as it is written, or as the rounded arguments have it
            multiples = np.abs(answers / units[mine] * taken)
            multiples = multiples[(multiples > _MULTIPLES[0]) & (multiples < _MULTIPLES[1])]
            whole = np.abs(multiples - np.round(multiples)) < _WHOLE
            if len(whole) >= _ENOUGH and whole.mean() >= _SHARE[False]:
                return f"errors of a difference quotient with a step of {text} ({how}), in the derivatives only", mine
    return None
