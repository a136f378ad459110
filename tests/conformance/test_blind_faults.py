"""Lists of some 150 faults in an independent program, planted without a look at the code of the diagnosis.

A line has a fault: its name, what a true diagnosis has to say, the `words` by which one that says it is told (regular
expression), the last of the `levels` answered (nine, if it does not say), and the `patches` that plant it in
`blind_program.py` and `blind_theory.py`. Lines without words are correct programs. Each list was written before a sheet
was graded, but for the words, which were chosen by hand from the verdicts.
A statement without these words counts as wrong until somebody has judged that it leads to the fault.

They are regression tests: the diagnosis was extended with most of them in view. At their first gradings
`blind_faults.jsonl` had 99 of 150 faults named truly, `blind_faults_second.jsonl` 95 (six statements false or
misleading, one traceback) and `blind_faults_third.jsonl` 106 (four false or misleading). `first` is the level that a
fault touches first.

At the first grading of `blind_faults_fourth.jsonl` 132 were called named by those who wrote the diagnosis; eight of
these say less than the fault. The lists after it say what a statement `must` say at least. One author wrote the fifth
to the seventh, another one the last three. They were judged by two readers each who did not know the diagnosis:

- fifth: 123 and 124 of 150 named, 7 and 6 less than the fault, 1 wrong, 19 unexplained;
- sixth: 120 and 118 of 150 named, 7 and 9 less than the fault, 2 wrong, 21 unexplained;
- seventh: 112 of 139 named by both, 8 and 9 less than the fault, 1 and 0 wrong, 18 unexplained;
- eighth: 133 and 136 of 150 named, 9 and 6 less than the fault, 1 wrong, 7 unexplained;
- ninth: 132 and 133 of 150 named, 7 and 6 less than the fault, 2 wrong, 9 unexplained;
- tenth: 119 and 117 of 130 named, 5 and 8 less than the fault, 1 and 0 wrong, 5 unexplained.

What was wrong was mended. The diagnosis was extended with the first seven lists in view before the eighth was graded,
and mended in few places between the last three. Where the first failing level is not the one that an author expected,
`first` has been put right: two faults fail at level 6 already, and one is no failure.
"""

from __future__ import annotations

import csv
import io
import json
import re
import sys
import types
from pathlib import Path
from typing import Any

import pytest

from tippedisk_verify.conformance.diagnosis import diagnosed
from tippedisk_verify.conformance.grading import graded, levels_of
from tippedisk_verify.conformance.sheet import questions, read_answers, sheet_csv
from tippedisk_verify.reference_values.store import Store, stored

HERE = Path(__file__).parent
TEXTS = [(HERE / name).read_text() for name in ("blind_theory.py", "blind_program.py")]
#: Each list, and how many of its faults have to be named. The others: see the names that the failing test prints.
NAMED = {
    "blind_faults.jsonl": 145, "blind_faults_second.jsonl": 144, "blind_faults_third.jsonl": 150,
    "blind_faults_fourth.jsonl": 133, "blind_faults_fifth.jsonl": 140, "blind_faults_sixth.jsonl": 136,
    "blind_faults_seventh.jsonl": 120, "blind_faults_eighth.jsonl": 141, "blind_faults_ninth.jsonl": 137,
    "blind_faults_tenth.jsonl": 122,
}  # fmt: skip
LISTS = {name: [json.loads(line) for line in (HERE / name).read_text().splitlines()] for name in NAMED}
CASES = [case for cases in LISTS.values() for case in cases]
FAULTS = {name: [case for case in cases if "words" in case] for name, cases in LISTS.items()}
CORRECT = [case for case in CASES if "words" not in case]
#: Within the four digits that level 6 asks for.
PASSING = {"event-bisection", "samples-4-decimals", "flat-newton-divides-by-acceleration"}
#: Some that take no orbit; the levels after the fault's own are left out.
QUICK = (
    ("inertia-swapped", 1), ("derivatives-mass", 1), ("eigenvalues-ascending", 2), ("equilibrium-inverted-only", 2),
    ("crit-square", 3), ("lyapunov-norm", 3), ("chi-e", 4), ("hb-B", 4), ("h_1-sign", 5), ("h-cross-terms", 5),
    ("h1-swapped", 1), ("rho-constant", 1), ("derivatives-abs", 1), ("noninverted-gamma-zero", 2),
    ("jacobian-gamma-row-sign", 2), ("lyapunov-no-conjugate", 3), ("frequency-no-root", 4), ("h_0-sine-gamma", 5),
    ("v-precedence", 1), ("eigenvalues-symmetric", 2), ("jacobian-inverted-A_31", 2), ("transversality-coarse", 3),
    ("hb-omega-2-decimals", 4), ("h-free-always", 5), ("equilibrium-gamma-ninety", 2),
    ("series-factorial", 5), ("h5-missing", 1),
)  # fmt: skip


def planted(case: dict[str, Any]) -> list[str]:
    """The texts of theory and program with the patches in them; each has to fit, and in one place."""
    texts = list(TEXTS)
    for old, new in case["patches"]:
        counts = [text.count(old) for text in texts]
        assert max(counts) == 1, (case["name"], old)
        texts = [text.replace(old, new) for text in texts]
    return texts


class Graders:
    """Answers a sheet with patched programs, and grades it. What a patch leaves as it was is not run again."""

    def __init__(self, folder: Path) -> None:
        self.store: Store = stored()
        self.asked = questions(self.store, sets=("printed",), frictions=(), levels=())
        self.rows = list(csv.DictReader(io.StringIO(sheet_csv(self.store, self.asked))))
        self.file = folder / "answers.json"
        self.kept: dict[Any, Any] = {}

    def __call__(self, case: dict[str, Any]) -> tuple[set[int], list[str]]:
        """The levels that fail, and the causes that the diagnosis states."""
        texts = planted(case)
        theory = types.ModuleType("blind_theory")
        exec(compile(texts[0], case["name"], "exec"), theory.__dict__)
        program: dict[str, Any] = {"__name__": "program", "TEXT": texts[1]}
        with pytest.MonkeyPatch.context() as patch:
            patch.setitem(sys.modules, "blind_theory", theory)
            exec(compile(texts[1], case["name"], "exec"), program)
            program["KEPT"].update(self.kept)
            answers = program["answered"](self.rows, range(1, case.get("levels", 9) + 1))
        self.kept = program["KEPT"]
        self.file.write_text(json.dumps(answers | {"from": "doubles"}))
        grades = graded(read_answers(self.file, self.store), self.store)
        failing = {level.level for level in levels_of(grades, self.asked) if level.failed}
        diagnoses = diagnosed(grades, self.store, lambda label, steps: None)
        return failing, [cause for diagnosis in diagnoses for _, cause in diagnosis.causes]


@pytest.fixture(scope="module")
def graders(tmp_path_factory: pytest.TempPathFactory) -> Graders:
    return Graders(tmp_path_factory.mktemp("blind"))


def test_each_patch_fits() -> None:
    assert len({case["name"] for case in CASES}) == len(CASES)
    assert [len(faults) for faults in FAULTS.values()] == [150] * 6 + [139, 150, 150, 130]
    for case in CASES:
        planted(case)


@pytest.mark.parametrize(("name", "levels"), QUICK)
def test_a_fault_without_orbits_is_named(name: str, levels: int, graders: Graders) -> None:
    case = next(case for case in CASES if case["name"] == name)
    failing, causes = graders(case | {"levels": levels})
    assert failing == {levels}
    assert causes
    assert all(re.search(case["words"], cause) for cause in causes)


def test_eigenvalues_at_another_speed_are_no_traceback(graders: Graders) -> None:
    """No value of a parameter gives them, and a search for one jumps through zero at another order of eigenvalues."""
    case = next(case for case in CASES if case["name"] == "eigenvalues-stale-speed")
    assert graders(case | {"levels": 2})[0] == {2}


def test_what_follows_from_the_other_law_is_not_diagnosed_again(graders: Graders) -> None:
    """Eigenvalues are common to both laws; a linear law without epsilon, named at level 1, spoils them."""
    case = next(case for case in CASES if case["name"] == "friction-no-epsilon")
    failing, causes = graders(case | {"levels": 2})
    assert failing == {1, 2}
    assert causes
    assert all(re.search(case["words"], cause) for cause in causes)


@pytest.mark.slow(minutes=10)
@pytest.mark.filterwarnings("ignore")  # what the faults do to the integrator
@pytest.mark.parametrize("name", NAMED)
def test_no_diagnosis_is_wrong_and_those_that_were_named_are(name: str, graders: Graders) -> None:
    named, unexplained, wrong = [], [], []
    for case in FAULTS[name]:
        failing, causes = graders(case)
        if "first" in case:
            assert min(failing, default=None) == (None if case["name"] in PASSING else case["first"]), case["name"]
        strange = [cause for cause in causes if not re.search(case["words"], cause)]
        wrong += [(case["name"], case["says"], cause) for cause in strange]
        (named if causes else unexplained).append(case["name"])
    print(f"{len(named)} named; unexplained: {', '.join(unexplained)}")
    assert not wrong
    assert len(named) >= NAMED[name]


@pytest.mark.slow(minutes=2)
@pytest.mark.filterwarnings("ignore")  # no more digits than doubles have
@pytest.mark.parametrize("case", CORRECT, ids=[case["name"] for case in CORRECT])
def test_correct_programs_pass(case: dict[str, Any], graders: Graders) -> None:
    assert graders(case) == (set(), [])
