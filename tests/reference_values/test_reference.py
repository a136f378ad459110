"""The reference data: whole, of the published form, twice derived, and honest."""

from __future__ import annotations

import contextlib
import json
import math
import os
import random
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from decimal import Decimal
from fractions import Fraction
from itertools import islice, product
from pathlib import Path

import mpmath
import pytest

from tests.dask_cluster import changed_package, surroundings
from tests.problems import paper_rates
from tests.stress.runs import LONGEST
from tests.stress.strikes import Struck, ended_by
from tippedisk_verify.cache import read_checked
from tippedisk_verify.cli import main
from tippedisk_verify.errors import InputError, Shortfall
from tippedisk_verify.model.exact import exact
from tippedisk_verify.model.measured import Measured
from tippedisk_verify.model.parameters import Parameters
from tippedisk_verify.reference_values.checking import StoredEntry, check, recomputed, stored_entries
from tippedisk_verify.reference_values.entries import as_doubles, as_measured, case_of, disagreements, trimmed
from tippedisk_verify.reference_values.generation import computed, generate, pieces_of
from tippedisk_verify.reference_values.kinds import KINDS, kind_named
from tippedisk_verify.reference_values.lookup import reference
from tippedisk_verify.reference_values.manifest import LARGEST, SETS, faults_in_files, write_manifest
from tippedisk_verify.reference_values.store import Store, data_folder, stored

_QUICK = ("equilibrium", "hopf", "harmonic-balance")


@pytest.fixture(scope="module")
def store() -> Store:
    return stored()


# ------------------------------------------------------------------------------------------ what is there
@pytest.mark.slow
def test_the_files_are_those_of_the_manifest_and_of_the_form_of_the_schema() -> None:
    report = check(data_folder(), sample=0)
    assert report.faults == ()
    assert report.numbers > 20_000


def test_every_kind_is_there_for_every_set(store: Store) -> None:
    kinds = {(quantity.kind, quantity.set) for quantity in store.values()}
    assert kinds == {(kind.name, name) for kind in KINDS for name in SETS}
    laws = {(quantity.kind, quantity.friction) for quantity in store.values()}
    for kind in (
        "rhs",
        "trajectory",
        "limit-cycle",
        "heteroclinic",
        "near-heteroclinic",
        "rotating-cycle",
        "rotation-fold",
    ):
        assert {(kind, "linear"), (kind, "smooth")} <= laws


def test_numbers_have_34_digits_and_omega_h_100(store: Store) -> None:
    for quantity in store.values():
        for reading in quantity.values:
            measured = quantity.measured(reading)
            # An angle is known to 34 digits of a radian even where it is nearly zero.
            size = max(abs(measured.value), Fraction(1) if quantity.kind == "trajectory" else Fraction(0))
            digits = 100 if quantity.name == "omega_h" else 34
            assert measured.uncertainty <= size / 10**digits, (quantity.id, reading)


def test_no_number_rests_on_a_single_road(store: Store) -> None:
    for quantity in store.values():
        assert (quantity.grade == "single") == (len(quantity.methods) == 1), quantity.id
        assert quantity.grade != "single", quantity.id


@pytest.mark.parametrize("name", SETS)
def test_doubles_are_the_nearest_ones(name: str) -> None:
    document = json.loads((data_folder() / name / "rhs.json").read_text())
    exact_set = Parameters.named(name)
    for symbol, told in document["parameters"].items():
        assert Fraction(told["decimal"]) == getattr(exact_set, symbol)
        assert float.fromhex(told["double"]) == float(told["decimal"])
        assert getattr(as_doubles(exact_set), symbol) == Fraction(float(told["decimal"]))
    for entry in document["entries"]:
        for symbol, text in entry["inputs_as_doubles"].items():
            assert float.fromhex(text) == float(entry["inputs"][symbol])


# ------------------------------------------------------------------------------------------ what it says
@pytest.mark.parametrize("name", SETS)
def test_the_right_hand_side_is_that_of_the_tests_own_transcription(name: str, store: Store) -> None:
    with mpmath.workdps(70):
        for n in (1, 40, 77, 110, 200):
            quantity = store[f"{name}/linear/rhs/{n:03d}/v_rate"]
            beta, gamma, v, omega = (Fraction(quantity.inputs[symbol]) for symbol in ("beta", "gamma", "v", "Omega"))
            state = tuple(mpmath.mpf(part.numerator) / part.denominator for part in (beta, gamma, v))
            rate = paper_rates(Parameters.named(name), omega, state)[2]
            assert quantity.measured().holds(rate)


def test_omega_crit_is_its_formula(store: Store) -> None:
    for name in SETS:
        p = Parameters.named(name)
        with mpmath.workdps(70):
            square = (p.r + p.e) ** 2 * p.m * p.g / (p.r * (p.B - p.m * p.e**2))
            value = mpmath.sqrt(mpmath.mpf(square.numerator) / square.denominator)
            assert store[f"{name}/linear/hopf/point/omega_crit"].measured().holds(value)


@pytest.mark.slow
def test_what_rounding_to_doubles_does_is_what_the_condition_numbers_say(store: Store) -> None:
    """Two independent statements of each entry: the second truth, and the slopes in its inputs."""
    shifts: dict[tuple[str, str], dict[str, Fraction]] = {}
    for quantity in store.values():
        if "doubles" not in quantity.values:
            continue
        key = (quantity.set, json.dumps(dict(quantity.inputs)))
        if key not in shifts:
            inputs = {**store.parameters[quantity.set], **quantity.inputs}
            shifts[key] = {}
            for symbol, told in inputs.items():
                text = told["decimal"] if isinstance(told, dict) else told
                try:
                    value = Fraction(text)
                except ValueError:
                    continue
                shifts[key][symbol] = Fraction(float(value)) / value - 1 if value else Fraction(0)
        moved = quantity.measured("doubles").value - quantity.measured("decimals").value
        parts = [exact(slope).rational * shifts[key][symbol] for symbol, slope in quantity.condition.items()]
        # The slopes have two or three digits, and near the connection only the leading term.
        size = sum(abs(part) for part in parts)
        noise = max(abs(quantity.measured().value), 1) / Fraction(10) ** 21
        assert abs(moved - sum(parts)) <= size / 10 + noise, quantity.id


# ------------------------------------------------------------------------------------------ other roads
@pytest.mark.parametrize("kind", ["rhs", "equilibrium", "hopf", "harmonic-balance", "slow-manifold"])
def test_other_roads_agree(kind: str) -> None:
    entries = [entry for entry in stored_entries(data_folder()) if entry.item.kind == kind]
    for entry in random.Random(7).sample(entries, min(12, len(entries))):
        count, faults = recomputed(entry)
        assert faults == []
        assert count > 0 or entry.item.friction == "both"


def _entries_of(kind: str, *parts: str) -> list[StoredEntry]:
    found = [entry for entry in stored_entries(data_folder()) if entry.item.kind == kind]
    return [entry for entry in found if all(part in entry.item.id for part in parts)]


def _disagreements(entry: StoredEntry, name: str) -> list[str]:
    """What one road says against the stored values of an entry; it must say something."""
    (road,) = (road for road in kind_named(entry.item.kind).roads if road.name == name)
    values = entry.values("doubles")
    answers = road.compute(case_of(entry.item, "doubles"), values)
    assert answers
    return disagreements(values, answers)


@pytest.mark.slow
def test_rotating_cycles_and_folds_agree_with_another_integrator() -> None:
    cycles, folds = _entries_of("rotating-cycle"), _entries_of("rotation-fold", "printed/")
    assert (len(cycles), len(folds)) == (20, 2)
    for entry in (*random.Random(9).sample(cycles, 4), *folds):
        assert _disagreements(entry, "scipy") == []


@pytest.mark.slow
def test_a_rotating_cycle_agrees_with_the_whole_period_from_another_section() -> None:
    (entry,) = _entries_of("rotating-cycle", "calibrated/smooth/", "/unstable-crit-0.5")
    assert _disagreements(entry, "bottom") == []
    quantity = entry.quantities["v_top"]
    told = quantity["from_doubles"]
    # Where 35 digits are claimed, a false one of the thirtieth is seen.
    wrong = as_measured(told).value * (1 + Fraction(1, 10**30))
    entry.quantities["v_top"] = {**quantity, "from_doubles": Measured(wrong, as_measured(told).uncertainty).to_dict()}
    (line,) = _disagreements(entry, "bottom")
    assert line.startswith("v_top")


@pytest.mark.slow(minutes=4)
@pytest.mark.parametrize("kind", ["rotating-cycle", "rotation-fold"])
def test_other_roads_to_what_rotates_agree(kind: str) -> None:
    for entry in random.Random(8).sample(_entries_of(kind), 2):
        count, faults = recomputed(entry)
        assert faults == []
        assert count > 0


def test_rotating_cycles_are_what_their_names_say(store: Store) -> None:
    """Which of two cycles an entry is, and relations between numbers that were found apart from each other."""
    for name, law in product(SETS, ("linear", "smooth")):
        fold = float(store[f"{name}/{law}/rotation-fold/point/omega"])
        omega_h = float(store[f"{name}/{law}/heteroclinic/point/omega_h"])
        leans = [
            float(store[f"{name}/{law}/rotating-cycle/{form}-het-0.01/beta_bar_0"]) for form in ("stable", "unstable")
        ]
        assert 0 < leans[0] < float(store[f"{name}/{law}/rotation-fold/point/beta_bar_0"]) < leans[1]
        for entry in {quantity.id.rsplit("/", 1)[0] for quantity in store.matching(f"{name}/{law}/rotating-cycle/")}:
            number = {quantity.name: quantity for quantity in store.matching(f"{entry}/")}
            omega, form = float(number["period"].inputs["Omega"]), number["period"].inputs["form"]
            assert fold < omega
            assert (omega < omega_h) == ("het" in entry)
            assert form in entry.rsplit("/", 1)[1]
            slow, logarithm = (float(number[f"{part}multiplier_slow"]) for part in ("", "log_"))
            assert (slow < 1) == (form == "stable")
            assert math.exp(logarithm) == pytest.approx(slow, rel=1e-14)  # exp amplifies by the logarithm
            assert float(number["beta_max"]) > float(number["beta_bar_top"]) > float(number["beta_bar_0"]) > 0
            # gamma' = Omega sin(beta_bar), averaged over a period, is 2 pi / T.
            assert math.sin(float(number["beta_bar_0"])) < 2 * math.pi / omega / float(number["period"])
            assert math.sin(float(number["beta_max"])) > 2 * math.pi / omega / float(number["period"])
            for known in ("period", "beta_bar_top", "v_top"):
                slope = float(number[known].condition["Omega"])  # by differences in double
                assert slope == pytest.approx(omega * float(number[f"d{known}_domega"]), rel=5e-3)


def test_a_false_digit_is_found_by_the_other_road() -> None:
    entry = next(entry for entry in stored_entries(data_folder()) if entry.item.id == "printed/linear/hopf/point")
    quantity = entry.quantities["period_slope"]
    value = quantity["value"]
    entry.quantities["period_slope"] = {**quantity, "value": value[:30] + str((int(value[30]) + 5) % 10) + value[31:]}
    _, faults = recomputed(entry)
    assert len(faults) == 1
    assert "period_slope" in faults[0]


@pytest.mark.slow
def test_a_thousand_entries_hold_by_their_other_roads() -> None:
    from tippedisk_verify.commands.reference import processes

    with processes(None) as pool:
        report = check(data_folder(), sample=1000, seed=20, executor=pool)
    assert report.faults == ()
    assert report.recomputed > 5_000


# ------------------------------------------------------------------------------------------ damage
def _flipped(folder: Path, draw: random.Random) -> Iterator[Path]:
    paths = sorted(path for path in folder.rglob("*") if path.is_file())
    while True:
        path = draw.choice(paths)
        content = path.read_bytes()
        place = draw.randrange(len(content))
        changed = bytearray(content)
        changed[place] ^= 1 << draw.randrange(8)
        path.write_bytes(bytes(changed))
        try:
            yield path
        finally:
            path.write_bytes(content)


@pytest.mark.slow
def test_any_flipped_bit_is_reported(tmp_path: Path) -> None:
    folder = tmp_path / "data"
    shutil.copytree(data_folder(), folder)
    assert faults_in_files(folder) == []
    flips = _flipped(folder, random.Random(3))
    for _ in range(60):
        path = next(flips)
        assert any(path.name in fault for fault in faults_in_files(folder)), path
    flips.close()
    manifest = folder / "manifest.json"
    content = manifest.read_bytes()
    for place in random.Random(4).sample(range(len(content)), 60):  # every part of the manifest itself, too
        manifest.write_bytes(content[:place] + bytes([content[place] ^ 1]) + content[place + 1 :])
        assert faults_in_files(folder)
    manifest.write_bytes(content)
    (folder / "printed" / "extra.json").write_text("{}")
    (folder / "notes.txt").write_text("not data")
    assert faults_in_files(folder) == ["printed/extra.json is not in the manifest"]


def test_a_manifest_that_points_elsewhere_reads_nothing(tmp_path: Path) -> None:
    (tmp_path / "secret").write_text("x")
    folder = tmp_path / "data"
    folder.mkdir()
    (folder / "README.md").write_text("x")
    write_manifest(folder)
    content = json.loads((folder / "manifest.json").read_text())
    content["files"]["../secret"] = content["files"]["README.md"]
    (folder / "manifest.json").write_text(json.dumps(content))
    assert "../secret is missing" in faults_in_files(folder)


@pytest.mark.slow
def test_numbers_that_differ_between_json_and_csv_are_reported(tmp_path: Path) -> None:
    folder = tmp_path / "data"
    shutil.copytree(data_folder(), folder)
    for name, old, new in (("values.csv", "two-method", "agreed"), ("sheet_with_truths.csv", ",10.0,", ",9.0,")):
        table = folder / "printed" / name
        whole = table.read_text()
        assert old in whole
        table.write_text(whole.replace(old, new, 1))
        write_manifest(folder)
        assert check(folder, sample=0).faults == (f"printed/{name} does not hold the same numbers as the JSON files",)
        table.write_text(whole)
    hopf = folder / "printed" / "hopf.json"
    hopf.write_text(hopf.read_text().replace('"grade"', '"mark"'))
    write_manifest(folder)
    assert any("schema.json" in fault for fault in check(folder, sample=0).faults)


# ------------------------------------------------------------------------------------------ generation
def _bytes(folder: Path) -> dict[str, bytes]:
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def _survives(tmp_path: Path, kills: int, seed: int) -> None:
    """Each kill leaves whole files only, and runs that go on make what one run makes."""
    words = ["reference", "generate", "--quiet", "--jobs", "1"]
    words += [*(word for kind in _QUICK for word in ("--only", kind)), "--out"]
    struck = Struck(tmp_path / "hand")
    whole, broken = tmp_path / "whole", tmp_path / "broken"
    lasts = struck.lasts([*words, str(whole)])
    expected = _bytes(whole)
    for status, _, _ in islice(struck.at_random([*words, str(broken)], signal.SIGKILL, lasts, seed), kills):
        assert status == -signal.SIGKILL
        for name, content in _bytes(broken).items():
            if not any(part.startswith(".") for part in Path(name).parts):
                assert content == expected[name], name
        for piece in broken.glob(".work/*.json"):
            assert read_checked(piece, LARGEST) is not None
        if (broken / "manifest.json").exists():
            shutil.rmtree(broken)
    generate(broken, only=_QUICK)
    assert _bytes(broken) == expected


@pytest.mark.slow
@pytest.mark.skipif(os.name == "nt", reason="no SIGKILL")
def test_killed_runs_leave_no_broken_file_and_can_be_resumed(tmp_path: Path) -> None:
    _survives(tmp_path, 4, 11)


@pytest.mark.slow
@pytest.mark.skipif(os.name == "nt", reason="no SIGKILL")
def test_fifty_kills(tmp_path: Path) -> None:
    _survives(tmp_path, 50, 12)


@pytest.mark.parametrize(
    "kinds",
    [("hopf", "equilibrium"), pytest.param(("rhs", "harmonic-balance", "slow-manifold"), marks=pytest.mark.slow)],
)
def test_threads_make_the_same_bytes(kinds: tuple[str, ...], tmp_path: Path) -> None:
    generate(tmp_path / "serial", only=kinds)
    with ThreadPoolExecutor(8) as pool:
        generate(tmp_path / "threads", only=kinds, executor=pool)
    assert _bytes(tmp_path / "threads") == _bytes(tmp_path / "serial")


def test_pieces_of_other_code_are_not_taken_up(tmp_path: Path) -> None:
    """A run with changed code of the same version was interrupted before it could put its pieces together."""
    whole, broken = tmp_path / "whole", tmp_path / "broken"
    generate(whole, only=("hopf",))
    (broken / ".work").mkdir(parents=True)
    program = (
        "import sys\nfrom pathlib import Path\nfrom tippedisk_verify.reference_values.generation import *\n"
        "from tippedisk_verify.reference_values.kinds import kind_named\n"
        "for name in ('printed', 'calibrated'):\n"
        "    for piece in pieces_of(kind_named('hopf'), name): computed(piece, Path(sys.argv[1]), piece.key)"
    )
    other = changed_package(
        tmp_path / "other", "reference_values/kinds.py", '"omega_crit": "rad/s"', '"omega_crit": "furlong"'
    )
    command = [sys.executable, "-c", program, str(broken / ".work")]
    subprocess.run(command, check=True, cwd=tmp_path, env=surroundings(other))
    assert all("furlong" in piece.read_text() for piece in (broken / ".work").glob("*.json"))
    assert list((broken / ".work").glob("*.json"))
    generate(broken, only=("hopf",))
    assert _bytes(broken) == _bytes(whole)


def test_a_process_with_other_code_computes_no_piece(tmp_path: Path) -> None:
    (piece,) = pieces_of(kind_named("hopf"), "printed")
    with pytest.raises(Shortfall, match="has changed"):
        computed(piece, tmp_path, piece.key[:-1])
    assert list(tmp_path.iterdir()) == []


@pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="needs /proc to see processes")
@pytest.mark.parametrize("how", [signal.SIGKILL, signal.SIGINT, signal.SIGTERM])
def test_workers_end_with_their_parent(how: signal.Signals, tmp_path: Path) -> None:
    command = [sys.executable, "-m", "tippedisk_verify", "reference", "generate", "--quiet", "--jobs", "2"]
    run = subprocess.Popen([*command, "--out", str(tmp_path)], stderr=subprocess.DEVNULL, start_new_session=True)

    def alive() -> list[str]:
        found = []
        for path in Path("/proc").glob("[0-9]*/stat"):
            with contextlib.suppress(OSError):
                fields = path.read_text().rsplit(")", 1)[1].split()
                if int(fields[3]) == run.pid and fields[0] != "Z":  # the session that the run leads
                    found.append(path.parent.name)
        return found

    until = time.monotonic() + LONGEST
    while len(alive()) < 4:  # itself, Python's tracker of semaphores, two workers
        assert time.monotonic() < until
        time.sleep(0.1)
    run.send_signal(how)
    assert run.wait(timeout=LONGEST) == ended_by(how)[0]
    until = time.monotonic() + LONGEST
    while alive() and time.monotonic() < until:
        time.sleep(0.2)
    assert alive() == []


def test_a_second_run_into_the_same_folder_is_refused(tmp_path: Path) -> None:
    fcntl = pytest.importorskip("fcntl")
    with open(tmp_path / ".lock", "w") as handle:
        fcntl.flock(handle, fcntl.LOCK_EX)
        with pytest.raises(InputError, match="another run"):
            generate(tmp_path, only=("hopf",))


def test_a_strangers_files_are_left_alone(tmp_path: Path) -> None:
    strange = [tmp_path / ".pre-commit-config", tmp_path / "sub" / ".env-local", tmp_path / "mydoc.txt"]
    (tmp_path / "sub").mkdir()
    for path in strange:
        path.write_text("mine")
    generate(tmp_path, only=("hopf",))
    assert all(path.read_text() == "mine" for path in strange)
    assert check(tmp_path, sample=0).faults == ()


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("schema.json", "{"), ("schema.json", "5"), ("schema.json", '{"type":"foo"}'),
        ("schema.json", '{"$ref":"http://example.invalid/x"}'), ("printed/hopf.json", "{"),
        ("printed/hopf.json", "[" * 100_000), ("printed/hopf.json", '{"entries": 5}'), ("printed/values.csv", "\udcff"),
    ],
)  # fmt: skip
def test_forged_folders_are_told(name: str, content: str, tmp_path: Path) -> None:
    """Damage with a manifest that fits is somebody's work; it still gives lines, not tracebacks."""
    folder = tmp_path / "data"
    shutil.copytree(data_folder(), folder)
    (folder / name).write_bytes(content.encode(errors="surrogateescape"))
    write_manifest(folder)
    assert check(folder, sample=0).faults


def test_a_folder_without_values_is_no_data(tmp_path: Path) -> None:
    for name in ("README.md", "schema.json"):
        shutil.copy(data_folder() / name, tmp_path)
    write_manifest(tmp_path)
    assert check(tmp_path, sample=0).faults == ("there are no reference values",)


@pytest.mark.parametrize("left", ['[{"id": "pri', "null", "5", "[5]", "[{}]", "[]", "[" * 100_000])
def test_damaged_pieces_are_computed_again(left: str, tmp_path: Path) -> None:
    generate(tmp_path / "whole", only=("hopf",))
    from tippedisk_verify.reference_values.generation import pieces_of
    from tippedisk_verify.reference_values.kinds import kind_named

    work = tmp_path / "other" / ".work"
    work.mkdir(parents=True)
    for name in SETS:
        for piece in pieces_of(kind_named("hopf"), name):
            (work / f"{piece.key}.json").write_text(left)
    generate(tmp_path / "other", only=("hopf",))
    assert _bytes(tmp_path / "other") == _bytes(tmp_path / "whole")


# ------------------------------------------------------------------------------------------ reading
def test_a_value_by_its_id() -> None:
    quantity = reference("printed/linear/hopf/point/omega_crit")
    assert quantity.unit == "rad/s"
    assert float(quantity) == pytest.approx(30.8866, abs=1e-4)  # a look at the leading digits
    assert quantity.measured().holds(quantity.measured().value)
    with pytest.raises(InputError, match="did you mean printed/linear/hopf/point/omega_crit"):
        reference("printed/linear/hopf/point/omega-crit")
    with pytest.raises(InputError, match="no value from doubles"):
        reference("printed/linear/near-heteroclinic/het+1e-30/period").measured("doubles")


@pytest.mark.parametrize(
    ("id_", "beginning"),
    [
        ("printed/linear/limit-cycle/crit-0.5/perod", "printed/linear/limit-cycle/crit-0.5/"),
        ("printed/linear/limit-cycle/crit-9/period", "printed/linear/limit-cycle/"),
        ("calibrated/smooth/hopf/point/omega_h", "calibrated/smooth/"),
        ("printed/linear/limit-cycle/crit-0.5", "printed/linear/limit-cycle/crit-0.5/"),
    ],
)
def test_suggested_ids_share_the_beginning_of_a_wrong_one(id_: str, beginning: str) -> None:
    with pytest.raises(InputError) as fault:
        reference(id_)
    suggested = str(fault.value).partition("did you mean ")[2].rstrip("?").split(" or ")
    assert 1 < len(suggested) <= 5
    assert all(one.startswith(beginning) for one in suggested)


@pytest.mark.parametrize("id_", ["", "../../etc/passwd", "printed/linear", "x" * 10_000, "printed/\0"])
def test_ids_that_do_not_exist(id_: str) -> None:
    with pytest.raises(InputError, match="no reference value"):
        reference(id_)


@pytest.mark.slow
def test_the_commands(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["reference", "list", "printed/linear/hopf", "--json"]) == 0
    ids = json.loads(capsys.readouterr().out)["ids"]
    assert "printed/linear/hopf/point/period" in ids
    assert main(["reference", "show", ids[0], "--json"]) == 0
    shown = json.loads(capsys.readouterr().out)["values"][0]
    assert Decimal(shown["uncertainty"]) < Decimal("1e-40")
    assert main(["reference", "show", ids[0]]) == 0
    assert "from doubles" in capsys.readouterr().out
    assert main(["reference", "check", "--sample", "3", "--jobs", "1", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["faults"] == []


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["reference", "show", "nothing"], "no reference value"),
        (["reference", "show", "omega_crit"], "did you mean printed/linear/hopf/point/omega_crit"),
        (["reference", "list", "nothing"], "starts with"),
        (["reference", "check", "--data", "nowhere"], "no reference data"),
        (["reference", "check", "--sample", "-1"], "negative"),
        (["reference", "generate", "--only", "nothing", "--out", "x"], "kind 'nothing'"),
        (["reference", "generate", "--set", "geometry", "--out", "x"], "are made for"),
        (["reference", "generate", "--out", ""], "name of a folder"),
        (["reference", "generate", "--jobs", "0", "--out", "x"], "--jobs"),
    ],
)
def test_bad_input(
    arguments: list[str], says: str, capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(arguments) == 2
    told = capsys.readouterr().err
    assert says in told
    assert told.count("\n") == 1
    assert not list(tmp_path.iterdir())


def test_rounding_keeps_the_promise() -> None:
    measured = Measured.of(Fraction(2, 3), Fraction(1, 10**60))
    short = trimmed(measured, 20)
    assert short.holds(Fraction(2, 3))
    assert short.uncertainty < Fraction(1, 10**20)


def test_words_stay_words_in_both_readings() -> None:
    entry = next(entry for entry in stored_entries(data_folder()) if entry.item.kind == "equilibrium")
    for reading in entry.item.readings:
        assert case_of(entry.item, reading).inputs["equilibrium"] in ("inverted", "noninverted")
