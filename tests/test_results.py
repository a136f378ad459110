"""Every kind of result is pickled, printed in ten lines, and shown as a table and as JSON."""

from __future__ import annotations

import copy
import json
import multiprocessing
import pickle
from collections.abc import Iterator
from concurrent.futures import Executor, ProcessPoolExecutor

import cloudpickle
import pytest

import tippedisk_verify as tv
from tippedisk_verify.display import Printable

START = ("pi/2", "pi/2 + 0.4", 0)
LEVEL = tv.Event("level", lambda ops, constants, omega, beta, gamma, v: gamma - 2, terminal=False)
DISK, CRIT = tv.Disk("table1"), "table1/linear/hopf/point/omega_crit"


class Lines(Printable):
    """A result of a given number of lines."""

    def __init__(self, count: int) -> None:
        self.count = count

    def __str__(self) -> str:
        return "\n".join(f"line {n}" for n in range(self.count))


RESULTS = {
    "disk": lambda: DISK,
    "omega_crit": lambda: DISK.omega_crit,
    "equilibrium": lambda: DISK.equilibrium("inverted", DISK.omega_crit - 0.5),
    "hopf": lambda: DISK.hopf(digits=50),
    "solution": lambda: DISK.integrate(
        DISK.omega_crit - 0.5, START, DISK.hopf().period, events=(LEVEL,)
    ),
    "basins": lambda: DISK.basins("30.4", count=20, duration=5.0),
    "limit cycle": lambda: DISK.limit_cycle(DISK.omega_crit - 0.5),
    "rotating cycle": lambda: DISK.rotating_cycle("30.5", stable=False),
    "branch": lambda: DISK.branch(["30.3", "30.4", "30.5", "30.6", "30.7"]),
    "connection": lambda: DISK.heteroclinic(method="bisection"),
    "reference": lambda: tv.reference(CRIT),
    "grade": lambda: tv.compare(CRIT, DISK.omega_crit),
    "report": lambda: tv.grade(
        {q.id: 1.001 * q.for_doubles for q in tv.references("table1/linear/hopf")}
    ),
    "one harmonic": lambda: tv.one_harmonic(DISK, "30.4"),
    "balanced cycle": lambda: tv.collocation_cycle(DISK, "30.4"),
    "slow manifold": lambda: tv.analyse_slow_manifold(DISK, "30.4", 1),
    "scene": lambda: tv.scene_named("a"),
    "panel": lambda: DISK.scene("d"),
    "event": lambda: DISK.integrate("30.4", START, 1, events="section").events[0],
    "proof": lambda: DISK.certify.equilibrium("inverted", "30.4"),
    "audit": lambda: tv.Audit(DISK, tv.Taylor()),
}


@pytest.mark.parametrize("count", [1, 9, 10, 11, 12, 13, 40])
def test_a_repr_is_cut_only_where_that_saves_more_than_a_line(count: int) -> None:
    lines = repr(Lines(count)).splitlines()
    if count <= 11:
        assert lines == str(Lines(count)).splitlines()
    else:
        assert (len(lines), lines[-1]) == (10, f"  and {count - 9} more lines: print shows them")


@pytest.mark.parametrize(
    "disk", [DISK, tv.Disk("geometry", friction="smooth"), tv.Disk("table1", mu="0.4", C=None)]
)
def test_the_repr_of_a_disk_is_whole(disk: tv.Disk) -> None:
    assert repr(disk) == str(disk)
    assert disk.name in repr(disk)
    assert disk.friction in repr(disk)
    assert all(f"  {name}: {text}" in repr(disk) for name, text in disk.decimals().items())


@pytest.fixture(scope="module")
def worker() -> Iterator[Executor]:
    with ProcessPoolExecutor(1, multiprocessing.get_context("spawn")) as pool:
        yield pool


@pytest.mark.parametrize("kind", RESULTS)
def test_a_result_is_copied_pickled_and_shown(kind: str, worker: Executor) -> None:
    result = RESULTS[kind]()
    expected = json.dumps(result.to_dict(), allow_nan=False)
    ways = (pickle.dumps, cloudpickle.dumps)
    copies = [
        copy.deepcopy(result),
        worker.submit(copy.copy, result).result(),
        *(pickle.loads(w(result)) for w in ways),
    ]
    for other in copies:
        assert json.dumps(other.to_dict()) == expected
        if isinstance(result, tv.Solution):
            assert (other(result.t[7]) == result(result.t[7])).all()
    assert worker.submit(repr, result).result() == repr(result)
    assert result._repr_html_().count("<tr>") >= len(result.to_dict()) > 0
    lines = repr(result).splitlines()
    assert len(lines) <= 11
    assert max(map(len, lines)) <= 100
    assert "more lines" not in str(result)
