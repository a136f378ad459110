"""Arithmetics that stand for other processors are what they say, and the studies that run in them can be believed."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import heyoka
import numpy
import pytest

from tests.stress.honesty.arithmetics import ARITHMETICS, DEFAULT, Arithmetic, arithmetic_named
from tests.stress.honesty.margins import LEAST
from tests.stress.honesty.study import lines, main
from tippedisk_verify.flow import compiled
from tippedisk_verify.flow.contract import Request
from tippedisk_verify.flow.lanes import BatchTaylor
from tippedisk_verify.model.parameters import PRINTED
from tippedisk_verify.model.precision import DOUBLE, EXTENDED, QUADRUPLE, companion

_HERE = [one for one in ARITHMETICS if one.here]
_REQUEST = Request(PRINTED, "30.4", ("1.4", "1.9", "0.5"), "0.5", domain="none")


def named(one: Arithmetic) -> str:
    return one.name


@pytest.mark.parametrize("arithmetic", _HERE, ids=named)
@pytest.mark.parametrize("kind", [float, numpy.longdouble], ids=["double", "extended"])
def test_what_is_compiled_has_the_options(arithmetic: Arithmetic, kind) -> None:
    x, v = heyoka.make_vars("x", "v")
    with arithmetic.active():
        stepper = compiled.heyoka_module().taylor_adaptive([(x, v), (v, -x)], [kind(0), kind(1)], fp_type=kind)
    plain = heyoka.taylor_adaptive([(x, v), (v, -x)], [kind(0), kind(1)], fp_type=kind)
    for name, value in {**arithmetic.options, **(arithmetic.in_double if kind is float else {})}.items():
        owner = stepper if hasattr(stepper, name) else stepper.llvm_state
        assert getattr(owner, name) == value != getattr(plain if owner is stepper else plain.llvm_state, name)
    orders = {"higher order": plain.order + 1, "lower order": plain.order - 1} if kind is float else {}
    assert stepper.order == orders.get(arithmetic.name, stepper.order)
    assert (stepper.tol == plain.tol) == (arithmetic.tolerance is None)


def test_outside_of_it_nothing_is_changed() -> None:
    before = compiled.heyoka_module
    with arithmetic_named("no x87").active():
        assert companion(DOUBLE) == QUADRUPLE
    assert compiled.heyoka_module is before
    assert companion(DOUBLE) == (EXTENDED if numpy.finfo(numpy.longdouble).nmant == 63 else QUADRUPLE)


def test_batches_are_as_wide_as_they_say() -> None:
    for arithmetic in ARITHMETICS:
        if arithmetic.width is not None:
            with arithmetic.active():
                assert BatchTaylor().width == arithmetic.lanes.width == arithmetic.width


def test_bits_move_by_the_seed_and_by_little() -> None:
    arithmetic, states = arithmetic_named("moved bits"), []
    for seed in (1, 1, 2):
        with arithmetic.active(seed):
            states.append(arithmetic.engine(_REQUEST).state)
    plain = DEFAULT.engine(_REQUEST).state
    assert (states[0] == states[1]).all()
    assert (states[0] != states[2]).any()
    # Some twenty steps of two units each, grown by less than ten over half a second.
    assert 0 < abs(states[0] - plain).max() < 400 * 2.0**-52


def test_derivatives_and_lanes_move_too() -> None:
    numbers = numpy.array([[1.0, -3e-9, 0.0]])
    moved = arithmetic_named("moved bits")._machine.with_moved_bits(numpy.repeat(numbers, 200, axis=0), 2)
    units = (moved - numbers) / numpy.spacing(abs(numbers))
    # Below 1 doubles lie half as far apart.
    assert set(units[:, 0]) == {-2, -1, 0, 1, 2}
    assert set(units[:, 1]) == {-2, -1, 0, 1, 2}
    assert not moved[:, 2].any()


def test_short_steps_are_more() -> None:
    arithmetic = arithmetic_named("short steps")
    with arithmetic.active():
        steps = arithmetic.engine(_REQUEST).steps
    assert steps > 1.5 * DEFAULT.engine(_REQUEST).steps


def test_an_environment_needs_a_process_of_its_own() -> None:
    elsewhere = next(one for one in ARITHMETICS if one.environment)
    with pytest.raises(RuntimeError, match="a process of its own"), elsewhere.active():
        pass
    assert Arithmetic("here", "", environment={"PATH": os.environ["PATH"]}).here


def test_the_study_goes_on_where_it_was_stopped(tmp_path: Path, capsys, monkeypatch) -> None:
    command = [str(tmp_path), "--row", "around", "--kind", "equilibria", "--jobs", "1", "--arithmetic", "default"]
    assert main([*command, "--draws", "63"]) == 0
    journal = tmp_path / "draws.jsonl"
    whole = journal.read_text(encoding="utf-8")
    assert len(lines(journal)) == 1
    journal.write_text(whole + whole.splitlines()[-1][:50], encoding="utf-8")  # a second one was cut off
    assert main([*command, "--draws", "64"]) == 0
    assert [line.index for line in lines(journal)] == [62, 63]
    assert "2 draws {'holds': 2}" in capsys.readouterr().out
    journal.write_text(whole.replace('"code": "', '"code": "x'), encoding="utf-8")
    assert main(command) == 2
    assert capsys.readouterr().err.count("\n") == 1


def run_margins(arithmetic: Arithmetic, *tests: str) -> tuple[int, dict[str, float], str]:
    done = subprocess.run(
        [sys.executable, "-m", "tests.stress.honesty.margins", arithmetic.name, *tests],
        capture_output=True,
        text=True,
        env={**os.environ, **arithmetic.environment},
        cwd=Path(__file__).parents[2],
    )
    found = json.loads(done.stdout.splitlines()[-1])
    assert not found["broken"], done.stdout
    return done.returncode, found["least"], done.stdout


@pytest.mark.slow
def test_margins_are_seen() -> None:
    test = "tests/orbits/test_scenes.py::test_flat_times_hold"
    status, least, _ = run_margins(arithmetic_named("moved bits"), test)
    assert list(least) == [test]
    assert status == (least[test] < LEAST)


@pytest.mark.slow
@pytest.mark.parametrize("arithmetic", ARITHMETICS, ids=named)
def test_no_fixed_case_rests_on_a_narrow_margin(arithmetic: Arithmetic, capsys) -> None:
    """Each test marked ``honest`` holds in every arithmetic, with twice what it needs."""
    _, least, shown = run_margins(arithmetic)
    with capsys.disabled():
        print(f"\n{arithmetic.name}: half-width / error\n{shown}")
    assert {test: margin for test, margin in least.items() if margin < LEAST} == {}
