"""The graders in Octave and JavaScript say of sheets of all kinds what `conformance grade` says."""

from __future__ import annotations

import math
import re
import shutil
import subprocess
from collections.abc import Callable
from itertools import cycle
from pathlib import Path

import pytest

from tippedisk_verify.commands.conformance_sources import FOLDER, GRADERS
from tippedisk_verify.conformance.grading import grade_answers, tally_levels
from tippedisk_verify.conformance.sheet import read_answers
from tippedisk_verify.errors import InputError
from tippedisk_verify.reference_values.store import ReferenceValue, Store, data_folder, load_store
from tippedisk_verify.support.files import csv_text

NODE = shutil.which("node")
OCTAVE = shutil.which("octave-cli") or shutil.which("octave")
ASKED = (
    *(f"table1/{law}/rhs/00{n}" for law in ("both", "linear", "smooth") for n in (1, 2)),
    "table1/both/equilibrium",
    "table1/linear/hopf",
    "table1/linear/harmonic-balance",
    "table1/linear/slow-manifold/0",
    "table1/linear/trajectory/d1/crossing",
    "table1/smooth/limit-cycle/crit-0.3",
    "table1/linear/heteroclinic",
    "table1/smooth/near-heteroclinic",
    "table1/linear/rotating-cycle",
)
#: Texts that say that there is no number, or are none that is read.
NO_NUMBERS = (
    "-nan(ind)",
    "1.#QNAN",
    "1.#INF",
    "-1.#IND00",
    "Inf32",
    "NA",
    "null",
    "nothing",
    "-Infinity",
    ".nan",
    "1.#J",
    "30,88",
    "1.5-3",
    "30.88`5x",
    "*****",
    "1.5+3000",
    "15+003",
    "30.88(12)",
    "\u22125",
    "0x1p3",
    "1/3",
)
#: What a program says: id -> (from, answer).
Sheet = dict[str, tuple[str, str]]
Said = tuple[set[tuple[str, str]], dict[int, tuple[int, int, str, float]], tuple[int, int]] | None


@pytest.fixture(scope="module")
def chosen() -> list[ReferenceValue]:
    return [quantity for quantity in load_store().values() if quantity.id.startswith(ASKED)]


@pytest.fixture(scope="module")
def table(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The rows of the shipped table for these questions."""
    path = tmp_path_factory.mktemp("truths") / "values.csv"
    head, *rows = (data_folder() / path.name).read_text().splitlines(keepends=True)
    path.write_text("".join([head, *(row for row in rows if row.startswith(ASKED))]))
    return path


def _right(chosen: list[ReferenceValue]) -> Sheet:
    return {
        quantity.id: (
            "doubles" if "doubles" in quantity.values else "decimals",
            repr(quantity.for_doubles),
        )
        for quantity in chosen
    }


def _changed(sheet: Sheet, where: str, change: Callable[[float], object]) -> Sheet:
    return {
        id_: (reading, str(change(float(answer))) if re.search(where, id_) else answer)
        for id_, (reading, answer) in sheet.items()
    }


def _sheets(chosen: list[ReferenceValue]) -> dict[str, str]:
    right = _right(chosen)
    digits = {quantity.id: quantity.values["decimals"][0] for quantity in chosen}
    last = right[chosen[-1].id]
    neighbours = dict(zip(right, [*list(right.values())[1:], last], strict=True))
    sheets = {
        "right": right,
        "from decimals": {id_: ("decimals", digits[id_]) for id_ in right},
        "decimals called doubles": {id_: ("doubles", digits[id_]) for id_ in right},
        "6 digits": _changed(right, "", lambda x: f"{x:.5e}"),
        "neighbours": neighbours,
        "no level 4": {id_: told for id_, told in right.items() if "harmonic-balance" not in id_},
        "none": dict.fromkeys(right, ("", "")),
        "NaN here and there": _changed(right, "v_rate$", lambda x: "NaN"),
        "NaN throughout": _changed(right, "equilibrium", lambda x: "nan"),
        "wrong ids": {id_.replace("omega_crit", "Omega_crit"): told for id_, told in right.items()},
        "shown by numpy": _changed(right, "hopf", lambda x: f"np.float64({x!r})"),
        "Fortran": _changed(right, "", lambda x: f"{x:.16e}".replace("e", "D")),
        "Fortran without the letter": _changed(
            right, "", lambda x: re.sub("e(.)", r"\g<1>0", f"{x:.16e}")
        ),
        "Mathematica": _changed(right, "", lambda x: f"{x:.16e}".replace("e", "`15.95*^")),
        "no numbers": dict(zip(right, (("", text) for text in cycle(NO_NUMBERS)), strict=False)),
    }
    texts = {
        name: csv_text(("id", "from", "answer"), ((id_, *told) for id_, told in sheet.items()))
        for name, sheet in sheets.items()
    }
    plain = texts["right"]
    texts["decimal commas"] = plain.replace(".", ",")
    texts["decimal commas in quotes"] = re.sub(r",(-?\d+)\.(\d+)$", r',"\1,\2"', plain, flags=re.M)
    texts["decimal commas between semicolons"] = plain.replace(",", ";").replace(".", ",")
    texts["tabs and twice"] = (
        (plain + plain.partition("\n")[2]).replace(",", "\t").replace("\n", "\r\n")
    )
    return texts


def _expected(path: Path, store: Store, chosen: list[ReferenceValue]) -> Said:
    try:
        answers = read_answers(path, store)
    except InputError:
        return None
    grades = grade_answers(answers, store)
    levels = {
        level.level: (level.answered, level.failed, level.verdict, level.least_digits)
        for level in tally_levels(grades, chosen)
    }
    failed = {(grade.verdict, grade.id) for grade in grades if grade.failed}
    return failed, levels, (len(answers.unknown_ids), len(answers.repeated_ids))


def _said(text: str) -> Said:
    failed = {
        (found[1], found[2])
        for found in re.finditer(
            r"^([a-z-]+) +(table1/\S+)  .*instead "
            r"of",
            text,
            re.M,
        )
    }
    pattern = r"level (\d+): (\d+) of \d+ answered, (\d+) failed(?:, least digits (\S+))?: (.*)"
    levels = {
        int(found[1]): (int(found[2]), int(found[3]), found[5].strip(), float(found[4] or "nan"))
        for found in re.finditer(pattern, text)
    }
    counts = re.search(r"(\d+) unknown ids, (\d+) repeated", text)
    return None if counts is None else (failed, levels, (int(counts[1]), int(counts[2])))


def _by_octave(names: list[str], folder: Path, table: Path) -> list[str]:
    """One process for all: starting it takes longer than grading."""
    call = "try, tippedisk_grade('{}', '{}'); catch fault, disp(fault.message), end, disp('====')"
    calls = "\n".join(call.format(folder / name, table) for name in names)
    command = [OCTAVE, "--no-gui", "--quiet", "--path", str(FOLDER), "--eval", calls]
    done = subprocess.run(command, check=True, timeout=600, capture_output=True, text=True)
    return done.stdout.split("====\n")[:-1]


def _by_node(names: list[str], folder: Path, table: Path) -> list[str]:
    program = [NODE, str(FOLDER / GRADERS["javascript"])]
    return [
        subprocess.run(
            [*program, str(folder / name), str(table)], check=False, capture_output=True, text=True
        ).stdout
        for name in names
    ]


@pytest.mark.parametrize(
    "run",
    [
        pytest.param(
            _by_octave,
            id="octave",
            marks=[
                pytest.mark.slow,
                pytest.mark.skipif(OCTAVE is None, reason="no GNU Octave here"),
            ],
        ),
        pytest.param(
            _by_node,
            id="javascript",
            marks=pytest.mark.skipif(NODE is None, reason="no Node.js here"),
        ),
    ],
)
def test_the_verdicts_are_those_of_conformance_grade(
    run: Callable[[list[str], Path, Path], list[str]],
    chosen: list[ReferenceValue],
    table: Path,
    tmp_path: Path,
) -> None:
    store = load_store()
    sheets = _sheets(chosen)
    for name, text in sheets.items():
        (tmp_path / f"{name}.csv").write_text(text)
    outputs = run([f"{name}.csv" for name in sheets], tmp_path, table)
    verdicts = set()
    for name, output in zip(sheets, outputs, strict=True):
        expected, said = _expected(tmp_path / f"{name}.csv", store, chosen), _said(output)
        assert (said is None) == (expected is None), name
        if said is None or expected is None:
            assert "is there a decimal comma?" in output or run is _by_node
            continue
        assert "-0.0:" not in output
        assert said[0] == expected[0], name
        assert said[2] == expected[2], name
        assert said[1].keys() == expected[1].keys(), name
        for level, (answered, failed, verdict, least) in expected[1].items():
            assert said[1][level][:3] == (answered, failed, verdict), (name, level)
            assert math.isnan(said[1][level][3]) == (answered == 0)
            # A double rounded in its sixteenth digit leaves the one decimal that is printed, up to
            # 13 digits.
            if least < 13:
                assert abs(said[1][level][3] - least) < 0.06, (name, level)
            verdicts.add(verdict)
    assert verdicts == {"agrees", "partial", "too few digits", "fails", "not answered"}
