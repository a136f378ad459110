"""Engines in many threads: the bytes of a serial run, with shared and separate engines."""

from __future__ import annotations

import random
import sys
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy
import pytest

from tests.problems import STARTS
from tippedisk_verify import (
    CALIBRATED,
    PRINTED,
    BatchTaylor,
    Event,
    Request,
    Result,
    ScipyEngine,
    Taylor,
    precision_of_bits,
)
from tippedisk_verify.flow import compiled_runners, default_batch_engine, default_engine
from tippedisk_verify.flow.batch import equation_constants
from tippedisk_verify.flow.contract import BETA_EXTREME, SECTION, SLIDING_REVERSAL

_THREADS = 8


@pytest.fixture(autouse=True)
def _frequent_switches() -> Iterator[None]:
    """Let threads take turns five hundred times as often as usual."""
    before = sys.getswitchinterval()
    sys.setswitchinterval(before / 500)
    yield
    sys.setswitchinterval(before)


def _in_threads(jobs: list[Callable[[], Any]], again: int = _THREADS) -> list[list[Any]]:
    """Return the results of all jobs in each of several threads, which start at different jobs."""

    def all_from(first: int) -> list[Any]:
        found = [job() for job in (*jobs[first:], *jobs[:first])]
        return found[len(jobs) - first :] + found[: len(jobs) - first]

    with ThreadPoolExecutor(again) as pool:
        return list(pool.map(all_from, range(0, len(jobs), len(jobs) // again)))


def _assert_as_alone(jobs: list[Callable[[], Any]], again: int = _THREADS) -> None:
    """Check that jobs in threads give what they give one after another."""
    serial = [job() for job in jobs]
    for found in _in_threads(jobs, again):
        assert found == serial


def _bytes(result: Result) -> tuple[object, ...]:
    parts = [
        result.state,
        result.samples,
        result.derivatives,
        *(record.state for record in result.events),
    ]
    times = [float(result.time).hex(), *(float(record.time).hex() for record in result.events)]
    return (
        result.status,
        result.steps,
        *times,
        *(None if part is None else part.tobytes() for part in parts),
    )


_EVENTS: tuple[tuple[Event, ...], ...] = ((), (SECTION,), (BETA_EXTREME, SLIDING_REVERSAL))


def _requests(count: int) -> list[Request]:
    """Return runs of many kinds in double, all of them short."""
    draw = random.Random(19)
    found = []
    for n in range(count):
        start = [draw.uniform(1.2, 1.9), draw.uniform(1, 2.2), draw.uniform(-2, 2)]
        options: dict[str, Any] = {"events": _EVENTS[n % 3]}
        if n % 4 == 1:
            options["times"] = [0.1, 0.2]
        if n % 4 == 2:  # of one kind only: they take long to compile
            options = {"variations": ("v",)}
        disk = (PRINTED, CALIBRATED)[n % 2].with_friction(
            "smooth" if n % 5 == 0 and n % 4 != 2 else "linear"
        )
        found.append(Request(disk, draw.uniform(30, 31), start, 0.3, **options))
    return found


def test_one_engine_that_keeps_little_in_four_threads(monkeypatch: pytest.MonkeyPatch) -> None:
    """Check that an integrator that is removed during a run finishes it, and is compiled again."""
    monkeypatch.setattr(compiled_runners, "_MAX_KEPT", 2)
    shared = Taylor()
    _assert_as_alone([lambda one=one: _bytes(shared(one)) for one in _requests(8)], 4)
    assert len(shared.builds) <= 2


def test_each_thread_has_an_engine() -> None:
    with ThreadPoolExecutor(1) as pool:
        assert pool.submit(default_engine).result() is not default_engine()
        assert pool.submit(default_batch_engine).result() is not default_batch_engine()
        assert pool.submit(default_engine).result() is pool.submit(default_engine).result()
    assert default_engine() is default_engine()


def test_one_batch_engine_in_threads() -> None:
    shared, constants = BatchTaylor(2), equation_constants(PRINTED.with_friction("smooth"))
    draw = numpy.random.default_rng(19)
    jobs = []
    for _ in range(40):
        states = draw.uniform((1.2, 1.0, -2.0), (1.9, 2.2, 2.0), size=(5, 3))
        arguments = (constants, draw.uniform(30, 31, 5), states, draw.uniform(0.2, 0.4, 5))

        def job(arguments: tuple[Any, ...] = arguments) -> tuple[object, ...]:
            flights = shared(
                *arguments,
                friction="smooth",
                events=(Event("turn", BETA_EXTREME.function, terminal=False),),
            )
            return flights.states.tobytes(), flights.crossings

        jobs.append(job)
    _assert_as_alone(jobs)


def test_continuous_output_is_for_all_threads() -> None:
    """Check while its integrator is on another run, too."""
    engine = default_engine()
    request = Request(PRINTED, 30.4, STARTS[1], 2.0, dense=True)
    dense = engine(request).dense
    times = numpy.linspace(0, 2, 400).reshape(80, 5)
    with ThreadPoolExecutor(1) as pool:
        other = pool.submit(
            lambda: [engine(request.starting_at((1.5, 1.9, n / 100))) for n in range(100)]
        )
        _assert_as_alone([lambda some=some: dense(some).tobytes() for some in times])
        other.result()


def test_scipy_engines_in_threads() -> None:
    """Check LSODA, which once kept the state of its run in the library."""
    shared = ScipyEngine("LSODA")
    requests = [
        request for request in _requests(16) if request.law.is_linear and not request.variations
    ]
    _assert_as_alone([lambda one=one: _bytes(shared(one)) for one in requests], 4)


def test_contexts_keep_their_precision() -> None:
    """Check while roots of polynomials raise their context's precision."""
    _assert_as_alone([lambda: str(precision_of_bits(150).context.polyroots([1, 2, 3, 4]))] * 16)
    assert precision_of_bits(150).context.prec == 150


def test_a_run_within_a_run_of_its_kind_is_refused() -> None:
    """Check that it is refused, because it would change the state of its caller.

    A run of another kind is allowed.
    """
    engine = Taylor()
    asked: list[Request] = []

    def function(ops: Any, constants: Any, omega: Any, beta: Any, gamma: Any, v: Any) -> Any:
        if isinstance(beta, float) and asked:
            engine(asked.pop())
        return 1 * v

    outer = Request(
        PRINTED, 30.4, STARTS[1], 0.3, events=(Event("asks", function, terminal=False),)
    )
    plain = _bytes(engine(outer))
    asked.append(Request(PRINTED, 30.4, STARTS[0], 0.3))
    assert _bytes(engine(outer)) == plain
    assert not asked
    asked.append(outer.starting_at(STARTS[0]))
    with pytest.raises(RuntimeError, match="second engine"):
        engine(outer)
    assert not asked
    assert _bytes(engine(outer)) == plain
