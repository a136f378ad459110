"""Engines in many threads: the bytes of a serial run, whoever shares what."""

from __future__ import annotations

import random
import sys
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import nullcontext
from pathlib import Path
from typing import Any

import numpy
import pytest

from tests.problems import STARTS
from tippedisk_verify.cycles.family import in_batches
from tippedisk_verify.cycles.interpolant import FamilyInterpolant
from tippedisk_verify.cycles.librating_family import LibratingFamily
from tippedisk_verify.cycles.section import LIBRATING
from tippedisk_verify.flow import compiled, default_engine, default_lanes
from tippedisk_verify.flow.baseline import Baseline
from tippedisk_verify.flow.contract import SECTION, SLIDING_REVERSAL, TURN, Event, Request, Result
from tippedisk_verify.flow.lanes import BatchTaylor, field_constants
from tippedisk_verify.flow.taylor import Taylor
from tippedisk_verify.model.parameters import CALIBRATED, PRINTED, Friction
from tippedisk_verify.model.precision import bits
from tippedisk_verify.motion.basins import basins
from tippedisk_verify.sweep.plan import Plan, axis
from tippedisk_verify.sweep.running import swept
from tippedisk_verify.theory.equilibria import equilibrium

_THREADS = 8


@pytest.fixture(autouse=True)
def _frequent_switches() -> Iterator[None]:
    """Threads take turns five hundred times as often as usual."""
    before = sys.getswitchinterval()
    sys.setswitchinterval(before / 500)
    yield
    sys.setswitchinterval(before)


def _in_threads(jobs: list[Callable[[], Any]], again: int = _THREADS) -> list[list[Any]]:
    """The jobs' results, all of them in each of several threads that begin at different ones."""

    def all_from(first: int) -> list[Any]:
        found = [job() for job in (*jobs[first:], *jobs[:first])]
        return found[len(jobs) - first :] + found[: len(jobs) - first]

    with ThreadPoolExecutor(again) as pool:
        return list(pool.map(all_from, range(0, len(jobs), len(jobs) // again)))


def _bytes(result: Result) -> tuple[object, ...]:
    parts = [result.state, result.samples, result.derivatives, *(record.state for record in result.events)]
    times = [float(result.time).hex(), *(float(record.time).hex() for record in result.events)]
    return result.status, result.steps, *times, *(None if part is None else part.tobytes() for part in parts)


_EVENTS: tuple[tuple[Event, ...], ...] = ((), (SECTION,), (TURN, SLIDING_REVERSAL))


def _requests(count: int) -> list[Request]:
    """Runs of many kinds in double, all of them short."""
    draw = random.Random(19)
    found = []
    for n in range(count):
        start = [draw.uniform(1.2, 1.9), draw.uniform(1, 2.2), draw.uniform(-2, 2)]
        options: dict[str, Any] = {"events": _EVENTS[n % 3]}
        if n % 4 == 1:
            options["times"] = [0.1, 0.2]
        if n % 4 == 2:  # of one kind only: they take long to compile
            options = {"variations": ("v",)}
        disk = (PRINTED, CALIBRATED)[n % 2].with_friction("smooth" if n % 5 == 0 and n % 4 != 2 else "linear")
        found.append(Request(disk, draw.uniform(30, 31), start, 0.3, **options))
    return found


@pytest.mark.slow
def test_one_engine_in_eight_threads() -> None:
    """A thousand requests each, of seven kinds of integrators."""
    requests, shared = _requests(1000), Taylor()
    serial = [_bytes(default_engine()(request)) for request in requests]
    jobs = [lambda request=request: _bytes(shared(request)) for request in requests]
    for found in _in_threads(jobs):
        assert sum(mine != theirs for mine, theirs in zip(serial, found, strict=True)) == 0
    assert len(shared.builds) == 7


def test_one_engine_that_keeps_little_in_eight_threads(monkeypatch: pytest.MonkeyPatch) -> None:
    """What leaves while another thread runs it ends its run, and is compiled again for the next."""
    monkeypatch.setattr(compiled, "_MOST_KEPT", 2)
    requests, shared = _requests(24), Taylor()
    serial = [_bytes(Taylor()(request)) for request in requests]
    jobs = [lambda request=request: _bytes(shared(request)) for request in requests]
    for found in _in_threads(jobs):
        assert found == serial
    assert len(shared.builds) <= 2


def test_each_thread_has_an_engine() -> None:
    with ThreadPoolExecutor(1) as pool:
        assert pool.submit(default_engine).result() is not default_engine()
        assert pool.submit(default_lanes).result() is not default_lanes()
        assert pool.submit(default_engine).result() is pool.submit(default_engine).result()
    assert default_engine() is default_engine()


def test_one_engine_above_double_in_threads() -> None:
    """Samples and error estimates, in numbers whose arithmetic has a state of its own."""
    shared = Taylor()
    requests = [
        Request(PRINTED, 30 + n / 10, STARTS[1], "0.02", precision=bits(100), times=["0.01"], error_estimate=True)
        for n in range(8)
    ]

    def told(request: Request) -> list[str]:
        result = shared(request)
        return [str(part) for part in (*result.state, *result.samples[0], *result.error.state)]

    serial = [told(request) for request in requests]
    for found in _in_threads([lambda request=request: told(request) for request in requests], 4):
        assert found == serial


@pytest.mark.parametrize("friction", ["linear", "smooth"])
def test_one_batch_engine_in_threads(friction: Friction) -> None:
    shared, constants = BatchTaylor(2), field_constants(PRINTED.with_friction(friction))
    draw = numpy.random.default_rng(19)
    jobs = []
    for _ in range(80):
        states = draw.uniform((1.2, 1.0, -2.0), (1.9, 2.2, 2.0), size=(5, 3))
        arguments = (constants, draw.uniform(30, 31, 5), states, draw.uniform(0.2, 0.4, 5))

        def job(arguments: tuple[Any, ...] = arguments) -> tuple[object, ...]:
            flights = shared(*arguments, friction=friction, events=(Event("turn", TURN.function, terminal=False),))
            return flights.states.tobytes(), flights.crossings

        jobs.append(job)
    serial = [job() for job in jobs]
    for found in _in_threads(jobs):
        assert found == serial


@pytest.mark.parametrize("friction", ["linear", "smooth"])
def test_continuous_output_is_for_all_threads(friction: Friction) -> None:
    """Also while its integrator is on another run."""
    engine = default_engine()
    request = Request(PRINTED.with_friction(friction), 30.4, STARTS[1], 2.0, dense=True)
    dense = engine(request).dense
    times = numpy.linspace(0, 2, 400).reshape(80, 5)
    serial = [dense(some).tobytes() for some in times]
    jobs = [lambda some=some: dense(some).tobytes() for some in times]
    with ThreadPoolExecutor(1) as pool:
        other = pool.submit(lambda: [engine(request.starting_at((1.5, 1.9, n / 100))) for n in range(100)])
        for found in _in_threads(jobs):
            assert found == serial
        other.result()


@pytest.mark.parametrize("method", ["DOP853", pytest.param("LSODA", marks=pytest.mark.slow)])
def test_the_baseline_in_threads(method: str) -> None:
    shared = Baseline(method)
    requests = [request for request in _requests(60) if request.friction == "linear"]
    jobs = [lambda request=request: _bytes(shared(request)) for request in requests[:40]]
    serial = [job() for job in jobs]
    for found in _in_threads(jobs, 4):
        assert found == serial


def test_contexts_keep_their_precision() -> None:
    """Roots of polynomials raise their context's precision for a while."""
    jobs = [lambda n=n: str(equilibrium(PRINTED, f"30.{n}", "noninverted", 50).eigenvalues) for n in range(16)]
    jobs += [lambda: str(bits(150).context.polyroots([1, 2, 3, 4]))] * 8
    serial = [job() for job in jobs]
    for found in _in_threads(jobs):
        assert found == serial
    assert bits(150).context.prec == 150


def test_a_run_within_a_run_of_its_kind_is_refused() -> None:
    """It would change the state of the run that it belongs to; one of another kind does not."""
    engine = Taylor()
    asked: list[Request] = []

    def function(ops: Any, constants: Any, omega: Any, beta: Any, gamma: Any, v: Any) -> Any:
        if isinstance(beta, float) and asked:
            engine(asked.pop())
        return 1 * v

    outer = Request(PRINTED, 30.4, STARTS[1], 0.3, events=(Event("asks", function, terminal=False),))
    plain = _bytes(engine(outer))
    asked.append(Request(PRINTED, 30.4, STARTS[0], 0.3))
    assert _bytes(engine(outer)) == plain
    assert not asked
    asked.append(outer.starting_at(STARTS[0]))
    with pytest.raises(RuntimeError, match="another engine"):
        engine(outer)
    assert not asked
    assert _bytes(engine(outer)) == plain


@pytest.mark.slow
def test_a_branch_of_cycles_in_threads() -> None:
    """One object whose errors are measured when they are first asked for, by whichever thread comes first."""
    speeds = [[30.1 + n / 50, 30.4 + n / 50] for n in range(8)]

    family = LibratingFamily(PRINTED, default_engine(), in_batches(LIBRATING, PRINTED, default_lanes()))
    serial = [repr(FamilyInterpolant(family, default_lanes()).results(some, 0)) for some in speeds]
    shared = FamilyInterpolant(family, default_lanes())
    for parallel in _in_threads([lambda some=some: repr(shared.results(some, 0)) for some in speeds]):
        assert parallel == serial


# ------------------------------------------------------------------------------------------ what promises any executor
@pytest.mark.parametrize(
    ("friction", "count"),
    [("linear", 5000), *(pytest.param(law, 20_000, marks=pytest.mark.slow) for law in ("linear", "smooth"))],
)
def test_basins_on_threads(friction: Friction, count: int) -> None:
    options: dict[str, Any] = {"count": count, "duration": 5.0}
    serial = basins(PRINTED.with_friction(friction), "30.4", **options)
    with ThreadPoolExecutor(_THREADS) as pool:
        found = basins(PRINTED.with_friction(friction), "30.4", executor=pool, **options)
    assert found.outcome.tobytes() == serial.outcome.tobytes()


@pytest.mark.parametrize(
    ("analysis", "axes", "digits"),
    [
        ("trajectory", ("omega=30.2:30.6:8", "v=0,1,2,3", "duration=1"), 12),
        ("hopf", ("g=9.7:9.9:40",), 30),
        *(
            pytest.param(*row, marks=pytest.mark.slow)
            for row in (
                ("trajectory", ("omega=30.2:30.6:20", "v=0,1,2,3,4,5,6,7,8,9"), 12),
                ("trajectory", ("omega=30.2:30.6:8", "duration=1"), 30), ("orbit", ("below-crit=0.1:0.7:40",), 12),
                ("heteroclinic", ("mu=0.25:0.35:6",), 12), ("heteroclinic", ("mu=0.25:0.35:6",), 30),
                ("equilibria", ("omega=30.1:30.9:100",), 60),
            )
        ),
    ],
)  # fmt: skip
def test_sweeps_on_threads(analysis: str, axes: tuple[str, ...], digits: int, tmp_path: Path) -> None:
    plan = Plan(analysis, PRINTED, tuple(axis(text) for text in axes), digits)
    swept(plan, tmp_path / "serial.csv", lambda: nullcontext(None))
    swept(plan, tmp_path / "threads.csv", lambda: ThreadPoolExecutor(_THREADS))
    assert (tmp_path / "threads.csv").read_bytes() == (tmp_path / "serial.csv").read_bytes()
