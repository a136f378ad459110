"""Relations of outputs, where wrong answers are, and lost digits: each is planted, and named first."""

from __future__ import annotations

import math
import random
import re
from collections.abc import Callable

import numpy as np
import pytest

from tippedisk_verify.conformance.diagnosis.entries import Sheet, tables_of
from tippedisk_verify.conformance.diagnosis.places import lost, where
from tippedisk_verify.conformance.diagnosis.relations import related
from tippedisk_verify.conformance.grading import graded
from tippedisk_verify.conformance.sheet import Answers, placed
from tippedisk_verify.reference_values.store import Quantity, stored

Change = Callable[[Quantity], "float | str"]


def right(quantity: Quantity) -> float:
    noise = random.Random(quantity.id).uniform(-1, 1) * (1e-14 if quantity.level < 6 else 1e-11)
    return quantity.for_doubles * (1 + noise)


def sheet(level: int, change: Change, prefix: str = "printed/") -> Sheet:
    asked = [q for q in stored().matching(prefix) if q.level == level and "doubles" in q.values]
    answers = {q.id: change(q) for q in asked}
    return of({id_: answer if isinstance(answer, str) else repr(float(answer)) for id_, answer in answers.items()})


def of(texts: dict[str, str]) -> Sheet:
    given = {id_: ("doubles", text) for id_, text in texts.items()}
    return Sheet(tuple(tables_of(graded(Answers(given), stored()), stored())))


def on(names: tuple[str, ...], function: Callable[[float], float | str]) -> Change:
    return lambda q: function(right(q)) if placed(q.name)[0].startswith(names) else right(q)


def asked(change: Callable[[str], str]) -> Change:
    """The answers to the questions that a change of the ids makes, where there are such questions."""
    return lambda q: right(stored().get(change(q.id), q))


def exchanged(one: str, two: str) -> Change:
    return asked(lambda id_: id_.replace(one, two) if one in id_ else id_.replace(two, one))


def moved(mark: str, by: int) -> Change:
    return asked(lambda id_: re.sub(rf"(?<={mark})\d+(?=/|$)", lambda n: f"{int(n[0]) + by:0{len(n[0])}d}", id_))


def eigenvalues(key: Callable[[complex], float]) -> Change:
    def answer(quantity: Quantity) -> float:
        entry, _, name = quantity.id.rpartition("/")
        parts = [[right(stored()[f"{entry}/lambda_{n}_{part}"]) for part in ("re", "im")] for n in (1, 2, 3)]
        number = sorted((complex(*pair) for pair in parts), key=key)[int(name[7]) - 1]
        return number.real if name.endswith("_re") else number.imag

    return answer


OF = " have the values of the "
RELATIONS: dict[str, tuple[int, Change, str]] = {
    "sign": (6, on(("beta",), lambda x: -x), "beta has the wrong sign"),
    "modulus": (1, on(("gamma_y",), abs), "gamma_y is the modulus of the right value"),
    "unit": (1, on(("f_G",), lambda x: 1000 * x), "f_G has the factor 1000"),
    "offset": (7, on(("gamma_bar_0",), lambda x: x + math.pi / 2), "gamma_bar_0 is pi/2 too large"),
    "turns": (6, on(("gamma",), lambda x: x % (2 * math.pi)), "gamma is reduced to [0, 2 pi)"),
    "exchanged": (1, exchanged("/M", "/h"), "M and h are exchanged"),
    "law": (6, exchanged("/linear/", "/smooth/"), "all answers" + OF + "other law"),
    "equilibrium": (2, exchanged("/inv", "/noninv"), "all answers" + OF + "other equilibrium"),
    "one equilibrium": (
        2,
        lambda q: right(q) * (-1) ** ("/noninv" in q.id),
        "have the wrong sign for the noninverted eq",
    ),
    "form": (4, exchanged("/printed-", "/consistent-"), "amplitude, frequency and period" + OF + "other form"),
    "entry": (1, moved("rhs/", -1), "all answers" + OF + "previous entry"),
    "order of eigenvalues": (2, eigenvalues(lambda z: z.imag), "in another order: ascending imaginary parts"),
    "next crossing": (6, moved("#", 1), "crossing_gamma, crossing_time and crossing_v" + OF + "next crossing"),
    "next order": (5, moved("_", -1), "h_n and residual_n" + OF + "previous order"),
    "zero": (2, lambda q: right(q) * q.name.endswith("_re"), "lambda_1_im, lambda_2_im and lambda_3_im are zero"),
    "six digits": (1, lambda q: f"{right(q):.6g}", "all answers are rounded to 6 significant digits"),
    "cut": (6, on(("v",), lambda x: math.trunc(1e3 * x) / 1e3), "v is truncated to 3 decimals"),
    "single": (1, lambda q: float(np.float32(right(q))), "all answers are rounded to single precision"),
}


@pytest.mark.parametrize("name", RELATIONS)
def test_relation_is_named_first(name: str) -> None:
    level, change, said = RELATIONS[name]
    planted = sheet(level, change)
    cause = related(planted)[0]
    assert said in cause.says


@pytest.mark.parametrize("level", range(1, 11))
def test_right_answers_and_noise_say_nothing(level: int) -> None:
    assert related(sheet(level, right)) == []
    assert lost(sheet(level, right)) is None
    assert where(sheet(level, right)) == ""
    noisy = sheet(level, lambda q: right(q) * (1 + random.Random(q.name + q.id).gauss(0, 0.1)))
    assert related(noisy) == []
    assert lost(noisy) is None


def perturbed(holds: Callable[[Quantity], bool]) -> Change:
    return lambda q: right(q) * (1.0 + random.Random(q.id + "x").uniform(0.1, 0.2) * holds(q))


@pytest.mark.parametrize(
    ("level", "holds", "said"),
    [
        (1, lambda q: q.name.startswith("dv_rate"), "only in derivatives"),
        (6, lambda q: "#" in q.name, "only in crossings"),
        (6, lambda q: q.friction == "smooth", "only for the smooth law"),
        (6, lambda q: "/a2/" in q.id, "only for the entry a2"),
        (7, lambda q: q.name in ("period", "v_0"), "only in period and v_0"),
    ],
)
def test_place_of_wrong_answers(level: int, holds: Callable[[Quantity], bool], said: str) -> None:
    assert where(sheet(level, perturbed(holds))) == said


def test_difference_tells_its_step() -> None:
    def change(q: Quantity) -> float:
        if not q.name.startswith("dv_rate"):
            return right(q)
        unit = math.ulp(stored()[q.id.rsplit("/", 1)[0] + "/v_rate"].for_doubles) / 1e-6
        return round(q.for_doubles / unit) * unit

    assert "a step of 1e-6" in (lost(sheet(1, change)) or ("",))[0]
