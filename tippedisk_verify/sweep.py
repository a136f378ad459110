"""Any analysis over many points: parameters, speeds and initial states, on one core, all cores or a cluster.

A point is a set of exact decimals. Points run on any `concurrent.futures.Executor`; each result goes to a journal
beside the output as soon as it is there, so that an interrupted sweep goes on where it stopped and no point is computed
twice. The output is written once, whole, in the order of the points, when all are there.
"""

from __future__ import annotations

import hashlib
import io
import itertools
import json
import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, Executor, Future, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass
from decimal import Decimal
from fractions import Fraction
from pathlib import Path
from typing import Any

from tippedisk_verify.errors import InputError, Shortfall
from tippedisk_verify.files import alone, checksum, write_bytes, write_csv
from tippedisk_verify.interrupts import undoing
from tippedisk_verify.model.equations import checked_friction, checked_speed
from tippedisk_verify.model.exact import exact
from tippedisk_verify.model.measured import Measured
from tippedisk_verify.model.parameters import Parameters
from tippedisk_verify.model.precision import checked_digits

__all__ = ["ANALYSES", "Plan", "axis", "executor_at", "swept"]

_PARAMETERS = ("r", "e", "m", "A", "B", "g", "mu", "epsilon")
_MOST_POINTS = 1_000_000
_MOST_BITS = 1_000_000_000  # of a range's numbers
_LONGEST_LINE = 1_000_000  # bytes of a journal's line
_WAITING = 4  # points for each worker that are handed out ahead
_REVIVALS = 5  # of a pool whose processes died


# ------------------------------------------------------------------------------------------ what can be swept
def _cycle(parameters: Parameters, point: Mapping[str, str], digits: int, friction: Any) -> dict[str, Any]:
    from tippedisk_verify.flow import default_engine
    from tippedisk_verify.orbits.continuation import followed_cycle

    options: dict[str, Any] = {"digits": digits, "friction": friction}
    cycle = followed_cycle(parameters, _speed(parameters, point, digits), default_engine(), **options)
    names = ("omega", "period", "gamma_bar_0", "v_0", "beta_max", "multiplier_slow", "log_multiplier_slow")
    found: dict[str, Any] = {name: getattr(cycle, name) for name in (*names, "log_multiplier_fast", "dperiod_domega")}
    return {**found, "stable": str(cycle.stable).lower()}


def _equilibria(parameters: Parameters, point: Mapping[str, str], digits: int, friction: Any) -> dict[str, Any]:
    from tippedisk_verify.theory.equilibria import equilibrium

    found: dict[str, Any] = {}
    for name in ("inverted", "noninverted"):
        state = equilibrium(parameters, _speed(parameters, point, digits), name, digits)
        for n, value in enumerate(state.eigenvalues, start=1):
            found |= {f"{name}_{n}_re": value.re, f"{name}_{n}_im": value.im}
        found[f"{name}_stable"] = str(state.stable).lower()
    return found


def _hopf(parameters: Parameters, point: Mapping[str, str], digits: int, friction: Any) -> dict[str, Any]:
    from tippedisk_verify.theory.hopf import hopf_point

    found = hopf_point(parameters, digits)
    return {name: getattr(found, name) for name in found.__dataclass_fields__}


def _heteroclinic(parameters: Parameters, point: Mapping[str, str], digits: int, friction: Any) -> dict[str, Any]:
    from tippedisk_verify.flow import default_engine
    from tippedisk_verify.orbits.heteroclinic import heteroclinic

    found = heteroclinic(parameters, default_engine(), digits=digits, friction=friction)
    return {"omega_h": found.omega_h, "saddle_value": found.saddle_value}


def _trajectory(parameters: Parameters, point: Mapping[str, str], digits: int, friction: Any) -> dict[str, Any]:
    from tippedisk_verify.flow import default_engine
    from tippedisk_verify.flow.contract import Request
    from tippedisk_verify.model.precision import DOUBLE, bits, bits_for_digits

    # Four digits go in a passage or two; the error estimate tells if they were more.
    precision = DOUBLE if digits <= 12 else bits(bits_for_digits(digits + 8))
    state = [point.get(name, default) for name, default in (("beta", "pi/2"), ("gamma", "pi/2 + 0.4"), ("v", "0"))]
    request = Request(
        parameters, _speed(parameters, point, digits), state, point.get("duration", "10"), friction=friction,
        precision=precision, error_estimate=True,
    )  # fmt: skip
    result = default_engine()(request)
    if result.error is None or not all(float(width) < float("inf") for width in result.error.state):
        raise Shortfall("rounding decides how this orbit ends: ask for more digits")
    numbers = {
        name: Measured.of(value, width)
        for name, value, width in zip(("beta", "gamma", "v"), result.state, result.error.state, strict=True)
    }
    return {"status": result.status.name.lower(), "time": Measured.of(result.time, result.error.time), **numbers}


def _speed(parameters: Parameters, point: Mapping[str, str], digits: int) -> Fraction:
    from tippedisk_verify.theory.hopf import omega_crit_decimal

    if "omega" in point:
        return checked_speed(point["omega"])
    below = exact(point["below-crit"])
    if below.pi_multiple:
        raise InputError("the distance below Omega_crit must be a decimal")
    return checked_speed(omega_crit_decimal(parameters, digits) - below.rational)


@dataclass(frozen=True)
class Analysis:
    """What is done at a point, and what a point may or must say beside the parameters."""

    says: str
    compute: Callable[[Parameters, Mapping[str, str], int, Any], dict[str, Any]]
    needs_speed: bool = True
    takes: tuple[str, ...] = ()


ANALYSES: dict[str, Analysis] = {
    "orbit": Analysis("the limit cycle at a speed", _cycle),
    "equilibria": Analysis("eigenvalues of both equilibria at a speed", _equilibria),
    "hopf": Analysis("the Hopf point", _hopf, needs_speed=False),
    "heteroclinic": Analysis("Omega_h", _heteroclinic, needs_speed=False),
    "trajectory": Analysis("the end of a trajectory", _trajectory, takes=("beta", "gamma", "v", "duration")),
}


# ------------------------------------------------------------------------------------------ points
def axis(text: str) -> tuple[str, tuple[str, ...]]:
    """``name=first:last:count`` or ``name=value,value,...`` as (name, exact decimals or ratios).

    Raises InputError with what is wrong.
    """
    name, sign, values = text.partition("=")
    name = name.strip()
    if not sign or not name or not values.strip():
        raise InputError(f"an axis is NAME=FIRST:LAST:COUNT or NAME=VALUE,VALUE,..., not '{text[:60]}'")
    if ":" not in values:
        found = tuple(value.strip() for value in values.split(","))
        for value in found:
            exact(value)
        return name, found
    parts = values.split(":")
    if len(parts) != 3 or not parts[2].strip().isascii() or not parts[2].strip().isdecimal() or len(parts[2]) > 9:
        raise InputError(f"a range is FIRST:LAST:COUNT, not '{values[:60]}'")
    first, last, count = exact(parts[0]), exact(parts[1]), int(parts[2])
    if not 2 <= count <= _MOST_POINTS or first.pi_multiple or last.pi_multiple:
        raise InputError(f"a range has decimal ends and 2 to {_MOST_POINTS} points, not '{values[:60]}'")
    step = (last.rational - first.rational) / (count - 1)
    if count * max(step.denominator.bit_length(), step.numerator.bit_length()) > _MOST_BITS:
        raise InputError(f"the ends of '{values[:60]}' are too long for so many points: round them")
    return name, tuple(_text(first.rational + n * step) for n in range(count))


def _text(value: Fraction) -> str:
    """An exact decimal if there is one, otherwise the ratio."""
    text, rest = Measured(value, Fraction(0)).decimals()
    # Decimal writes integers of any length.
    return text if rest == "0" else f"{Decimal(value.numerator)}/{Decimal(value.denominator)}"


@dataclass(frozen=True)
class Plan:
    """A sweep: the analysis, what stays, and the axes whose every combination is a point."""

    analysis: str
    parameters: Parameters
    axes: tuple[tuple[str, tuple[str, ...]], ...]
    digits: int = 12
    friction: str = "linear"

    def __post_init__(self) -> None:
        if self.analysis not in ANALYSES:
            raise InputError(f"analysis '{self.analysis[:40]}' is not known: use {', '.join(ANALYSES)}")
        analysis = ANALYSES[self.analysis]
        names = [name for name, _ in self.axes]
        known = (*_PARAMETERS, *(("omega", "below-crit") if analysis.needs_speed else ()), *analysis.takes)
        for name in names:
            if name not in known:
                raise InputError(f"{self.analysis} cannot be swept over '{name[:40]}': use {', '.join(known)}")
        if len(set(names)) != len(names):
            raise InputError("an axis is given twice")
        if analysis.needs_speed and ("omega" in names) == ("below-crit" in names):
            raise InputError(f"{self.analysis} needs either omega or below-crit as an axis (one value will do)")
        checked_digits(self.digits)
        checked_friction(self.friction)
        if not 0 < len(self) <= _MOST_POINTS:
            raise InputError(f"a sweep has 1 to {_MOST_POINTS} points, not {len(self)}")

    def __len__(self) -> int:
        count = 1
        for _, values in self.axes:
            count *= len(values)
        return count if self.axes else 0

    def points(self) -> Iterator[dict[str, str]]:
        """Every combination, the last axis fastest."""
        names = [name for name, _ in self.axes]
        for values in itertools.product(*(values for _, values in self.axes)):
            yield dict(zip(names, values, strict=True))

    @property
    def key(self) -> str:
        """A hash of everything that the results depend on."""
        from tippedisk_verify import __version__

        fixed = [_text(getattr(self.parameters, name)) for name in _PARAMETERS]
        text = json.dumps([__version__, self.analysis, fixed, self.axes, self.digits, self.friction])
        return hashlib.sha256(text.encode()).hexdigest()


def computed(plan: Plan, point: Mapping[str, str]) -> dict[str, str]:
    """A row: the point, the numbers with their half-widths, and ``status``: ok, or why there are no numbers."""
    row = dict(point)
    try:
        changes = {name: value for name, value in point.items() if name in _PARAMETERS}
        parameters = plan.parameters.changed(**changes) if changes else plan.parameters
        found = ANALYSES[plan.analysis].compute(parameters, point, plan.digits, plan.friction)
    except (InputError, Shortfall, ArithmeticError) as fault:
        return row | {"status": " ".join(str(fault).split())[:200] or type(fault).__name__}
    row["status"] = "ok"
    for name, value in found.items():
        if isinstance(value, Measured):
            row[name], row[f"{name}_uncertainty"] = value.decimals()
        else:
            row["ended" if name == "status" else name] = str(value)
    return row


# ------------------------------------------------------------------------------------------ running
def swept(
    plan: Plan,
    out: Path,
    *,
    pool: Callable[[], AbstractContextManager[Executor | None]],
    workers: int = 1,
    advance: Callable[[str, int], None] = lambda label, steps: None,
) -> tuple[int, int]:
    """Run the plan and write ``out`` (.csv or .parquet); returns (points, those of them that have no numbers).

    ``pool`` makes the executor, anew if its processes died. What an interrupted run of the same plan left in the
    journal is taken up. Raises InputError for an unknown kind of file or a journal of another plan.
    """
    if out.suffix.lower() not in (".csv", ".parquet"):
        raise InputError(f"'{out.name}' must end in .csv or .parquet")
    if out.suffix.lower() == ".parquet":
        _arrow()
    journal = out.with_name(f".{out.name}.journal")
    with alone(journal, f"another run is sweeping into {out}: wait for it, or give another --out"):
        points = list(plan.points())
        rows = _taken_up(journal, plan, points)

        def discard() -> None:
            if not rows:  # nothing is lost with it
                journal.unlink(missing_ok=True)

        advance("taken up", len(rows))
        try:
            with undoing(discard):
                return _swept(plan, out, journal, points, rows, pool, workers, advance)
        except BaseException:
            discard()
            raise


def _swept(
    plan: Plan,
    out: Path,
    journal: Path,
    points: Sequence[dict[str, str]],
    rows: dict[int, dict[str, str]],
    pool: Callable[[], AbstractContextManager[Executor | None]],
    workers: int,
    advance: Callable[[str, int], None],
) -> tuple[int, int]:
    with open(journal, "a", encoding="utf-8") as stream:
        if not stream.tell():
            stream.write(_head(plan).decode())

        def keep(index: int, row: dict[str, str]) -> None:
            rows[index] = row
            stream.write(_line(index, row))
            stream.flush()
            os.fsync(stream.fileno())
            advance(row["status"][:40], 1)

        for attempt in range(_REVIVALS + 1):
            missing = [index for index in range(len(points)) if index not in rows]
            try:
                with pool() as executor:
                    _run(plan, points, missing, executor, workers, keep)
                break
            except BrokenProcessPool:
                if attempt == _REVIVALS:
                    raise Shortfall(
                        f"the processes died {_REVIVALS + 1} times; {len(rows)} points are kept, run again to go on"
                    ) from None
    _write(out, [rows[index] for index in range(len(points))])
    journal.unlink()
    return len(points), sum(row["status"] != "ok" for row in rows.values())


def _run(
    plan: Plan,
    points: Sequence[dict[str, str]],
    missing: Sequence[int],
    executor: Executor | None,
    workers: int,
    keep: Callable[[int, dict[str, str]], None],
) -> None:
    if executor is None:
        for index in missing:
            keep(index, computed(plan, points[index]))
        return
    ahead = iter(missing)
    waiting: dict[Future[dict[str, str]], int] = {}
    while True:
        for index in itertools.islice(ahead, max(1, _WAITING * workers - len(waiting))):
            waiting[executor.submit(computed, plan, points[index])] = index
        if not waiting:
            return
        done, _ = wait(waiting, return_when=FIRST_COMPLETED)
        for future in done:
            keep(waiting.pop(future), future.result())


def _taken_up(journal: Path, plan: Plan, points: Sequence[Mapping[str, str]]) -> dict[int, dict[str, str]]:
    """Rows that an interrupted run has left; cut off from the first line on whose checksum does not fit.

    That is the line that was being written when it ended. Raises InputError if the file does not begin as a journal of
    this plan: it is another's.
    """
    if not journal.exists():
        return {}
    rows: dict[int, dict[str, str]] = {}
    with open(journal, "r+b") as stream:
        first, head = stream.readline(_LONGEST_LINE), _head(plan)
        if not head.startswith(first):
            raise InputError(f"{journal} belongs to another sweep: remove it, or give another --out")
        whole = len(first) if first == head else 0
        while whole and (kept := _kept(line := stream.readline(_LONGEST_LINE), len(points))):
            rows[kept[0]] = kept[1]
            whole += len(line)
        stream.truncate(whole)
    return rows


def _head(plan: Plan) -> bytes:
    return (json.dumps({"plan": plan.key}) + "\n").encode()


def _line(index: int, row: Mapping[str, str]) -> str:
    return json.dumps({"point": index, "row": row, "checksum": checksum([index, row])}) + "\n"


def _kept(line: bytes, count: int) -> tuple[int, dict[str, str]] | None:
    """The point and the row of a journal's line, if it is as `_line` wrote it."""
    try:
        entry = json.loads(line)
        index, row = entry["point"], entry["row"]
        good = line.endswith(b"\n") and entry["checksum"] == checksum([index, row]) and 0 <= index < count
    except (ValueError, KeyError, TypeError, RecursionError):
        return None
    return (index, row) if good and isinstance(row, dict) else None


def _columns(rows: Sequence[Mapping[str, str]]) -> list[str]:
    """All columns in order of appearance, the status before the numbers."""
    return list(dict.fromkeys(name for row in rows for name in row))


def _write(out: Path, rows: Sequence[Mapping[str, str]]) -> None:
    columns = _columns(rows)
    if out.suffix.lower() == ".csv":
        write_csv(out, columns, [[row.get(name, "") for name in columns] for row in rows])
        return
    arrow, parquet = _arrow()
    # Decimal strings, as everywhere: a double would lose digits.
    table = arrow.table({name: [row.get(name) for row in rows] for name in columns})
    stream = io.BytesIO()
    parquet.write_table(table, stream)
    write_bytes(out, stream.getvalue())


def _arrow() -> tuple[Any, Any]:
    try:
        import pyarrow
        import pyarrow.parquet
    except ImportError:
        raise InputError("Parquet needs pyarrow: pip install 'tippedisk-verify[cluster]', or write .csv") from None
    return pyarrow, pyarrow.parquet


@contextmanager
def executor_at(address: str) -> Iterator[Executor]:
    """The executor of a Dask cluster, ``dask://HOST:PORT``. Raises InputError if it cannot be reached."""
    try:
        from distributed import Client
    except ImportError:
        raise InputError("a Dask cluster needs distributed: pip install 'tippedisk-verify[cluster]'") from None
    host = address.removeprefix("dask://")
    try:
        client: Any = Client(f"tcp://{host}", timeout="4s", set_as_default=False)  # type: ignore[no-untyped-call]
    except (OSError, TimeoutError, ValueError) as fault:
        raise InputError(f"no Dask scheduler at {host[:80]}: {str(fault)[:80] or type(fault).__name__}") from None
    try:
        # A worker that dies takes its points along; the scheduler gives them to another, three times at most.
        yield client.get_executor(pure=False, retries=3)
    finally:
        client.close()
