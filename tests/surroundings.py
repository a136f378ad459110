"""A call of every public function with its result as text to the last bit, and the states that a
caller may have set.

As a program it prints the results of the quick calls as JSON, for an interpreter with other
settings.
"""

from __future__ import annotations

import contextlib
import decimal
import inspect
import json
import locale
import random
import sys
import tempfile
import warnings
from collections.abc import Callable, Iterator, Sequence
from functools import _lru_cache_wrapper, cached_property, partial
from importlib import import_module
from pathlib import Path
from typing import Any
from unittest.mock import patch

import flint
import gmpy2
import mpmath
import numpy as np
import pytest

import tippedisk_verify as tv
from tests.command_line import ran
from tippedisk_verify.certify import Certifier
from tippedisk_verify.cycles import locator
from tippedisk_verify.cycles.branch import Branch
from tippedisk_verify.cycles.limit_cycle import Cycle
from tippedisk_verify.flow.jit import heyoka_module
from tippedisk_verify.motion.basin_boundary import BasinBoundary
from tippedisk_verify.omega_h.connecting_orbit import Heteroclinic

# It draws from Python's generator as it is loaded, for a call that takes long
import_module("rich.style")
ID, START = "table1/linear/hopf/point/period", ("pi/2", "pi/2 + 0.4", 0)
#: The classes whose public methods and properties are called, beside the package's functions.
CLASSES = (
    *(tv.Disk, Certifier, tv.Solution, Cycle, Branch, Heteroclinic, BasinBoundary, tv.Measured),
    *(tv.Taylor, tv.ScipyEngine, tv.BatchTaylor),
)


def public() -> Iterator[str]:
    """Every public function, and every method and computed property of `CLASSES`."""
    for name in tv.__all__:
        if inspect.isroutine(getattr(tv, name)):
            yield name
    kinds = (property, cached_property, classmethod, staticmethod)
    for kind in CLASSES:
        for name, member in vars(kind).items():
            if (name[0] != "_" or name == "__call__") and (
                inspect.isfunction(member) or isinstance(member, kinds)
            ):
                yield f"{kind.__name__}.{name}"


def as_text(result: Any) -> str:
    """A result to its last bit."""
    if isinstance(result, np.ndarray):
        return f"{result.shape} {[as_text(entry) for entry in result.ravel().tolist()]}"
    if isinstance(result, tuple | list):
        return f"{[as_text(entry) for entry in result]}"
    if isinstance(result, float):
        return result.hex()
    if hasattr(result, "to_dict"):
        return json.dumps(result.to_dict()) + repr(result)
    if hasattr(result, "savefig"):  # a figure
        return as_text([line.get_xydata() for axes in result.axes for line in axes.lines])
    try:
        number = tv.exact(result)
        return f"{number.rational.numerator:x}/{number.rational.denominator:x} + {number.pi_multiple} pi"
    except tv.InputError:
        return str(result)


DISK = tv.Disk("table1")
LAW = tv.Disk("table1", friction="smooth")


_CONSTANTS = [0.045, 0.0025, 5e-4, 5e-4, 9.81, 29.0]


def _written(disk: tv.Disk) -> tv.Disk:
    """The disk from a file."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "disk.toml"
        disk.to_toml(file)
        return tv.Disk.read(file)


def _loaded(result: Any) -> Any:
    """Save a result and load it again."""
    with tempfile.TemporaryDirectory() as folder:
        return tv.load(result.save(Path(folder) / "result.json"))


def _framed(result: Any) -> str:
    """Ask for a data frame without pandas, which is optional; the result is its refusal."""
    with patch.dict(sys.modules, {"pandas": None}), contextlib.suppress(tv.InputError):
        return str(result.to_dataframe())
    return "refused"


def _asked(result: Any, *questions: str | Callable[[Any], Any]) -> list[Any]:
    """Ask a new result for attributes by name, which are called if they are methods, and by
    function.
    """
    answers = []
    for question in questions:
        answer = getattr(result, question) if isinstance(question, str) else question(result)
        answers.append(answer() if inspect.ismethod(answer) else answer)
    return answers


def _certified(proof: Any) -> str:
    return proof.certificate() if hasattr(proof, "certificate") else as_text(proof)


COMMANDS = (
    "integrate --omega 30.4 --state pi/2,pi/2+0.4,0 --time 1 --times 4",
    "hopf --digits 700 --json",
    "equilibria --below-crit 0.5",
    "verify --only omega_crit,kappa_2",
    "reference show table1/linear/hopf/point/period",
    "nothing",
)
#: A call of each, or of several by their names. What a result can be asked is asked of a new one,
#: so that nothing was computed before.
CALLS: dict[str, Callable[[], Any]] = {
    "analyse_slow_manifold": lambda: tv.analyse_slow_manifold(DISK, "30.4", 2),
    "collocation_cycle": lambda: tv.collocation_cycle(DISK, "30.4"),
    "basins": lambda: tv.basins(DISK, "30.4", count=30, duration=5),
    "bisect_omega_h": lambda: tv.bisect_omega_h(DISK, tv.Taylor(), confirm=False),
    "precision_of_bits": lambda: tv.precision_of_bits(100),
    "compare": lambda: [
        tv.compare(ID, answer) for answer in (0.88, "0.886", tv.Measured.of("8867/10000", 0))
    ],
    "cycle_above_omega_h": lambda: tv.cycle_above_omega_h(DISK, "0.1", tv.Taylor()),
    "equilibrium": lambda: tv.equilibrium(DISK, "30.4", "noninverted", 40),
    "exact": lambda: [
        tv.exact(value) for value in ("1/3", "pi/2 + 0.4", 0.1, "0." + "3" * 1000 + "/7")
    ],
    "grade": lambda: tv.grade(
        {q.id: 1.001 * q.for_doubles for q in tv.references("table1/linear/hopf")}
    ),
    "heteroclinic": lambda: tv.heteroclinic(DISK, tv.Taylor()),
    "hopf_point": lambda: tv.hopf_point(DISK, 1000),
    "omega_crit": lambda: [tv.omega_crit(DISK, digits) for digits in (12, 50)],
    "one_harmonic": lambda: tv.one_harmonic(DISK, "30.4"),
    "period_crit": lambda: tv.period_crit(DISK),
    "problem_named": lambda: tv.problem_named("transient").source("c"),
    "reference": lambda: tv.reference(ID),
    "references": lambda: tv.references("table1/linear/hopf"),
    "scene_named": lambda: tv.scene_named("a"),
    "Disk.basin_boundary": lambda: DISK.basin_boundary("31.4"),
    "Disk.basins": lambda: DISK.basins("30.4", count=30, duration=5),
    "Disk.certify": lambda: DISK.certify,
    "Disk.equilibrium": lambda: DISK.equilibrium("inverted", "30.4"),
    "Disk.folds": lambda: tv.Disk("table1", A="0.2455e-3").folds(),
    "Disk.harmonic_balance": lambda: DISK.harmonic_balance("30.4", digits=20),
    "Disk.heteroclinic": lambda: DISK.heteroclinic(),
    "Disk.hopf": lambda: DISK.hopf(),
    "Disk.integrate": lambda: [
        disk.integrate(
            "30.4", START, 1, events=("section", "surface"), digits=digits, engine=engine
        )
        for disk, digits, engine in (
            (DISK, 12, None),
            (LAW, 12, None),
            (DISK, 12, tv.ScipyEngine()),
        )
    ],
    "Disk.jacobian": lambda: DISK.jacobian("30.4")(0, [1.5, 1.6, 0]),
    "Disk.limit_cycle": lambda: [
        LAW.limit_cycle("30.4"),
        DISK.limit_cycle(below_crit="1e-3"),
    ],
    "Disk.sensitivity": lambda: DISK.sensitivity(),
    "Disk.near_heteroclinic": lambda: DISK.near_heteroclinic(["1e-3", "1e-7"]),
    "Disk.omega_crit": lambda: (
        f"{DISK.omega_crit:.30g} {DISK.omega_crit} {DISK.omega_crit.uncertainty:.3g}"
    ),
    "Disk.read": lambda: _written(DISK).to_dict(),
    "Disk.rhs": lambda: DISK.rhs("30.4")(0, [1e-310, 1.6, 1e-310]),
    "Disk.rotating_branch": lambda: DISK.rotating_branch(["30.04"]),
    "Disk.rotating_cycle": lambda: DISK.rotating_cycle("30.5", stable=False),
    "Disk.rotation_fold": lambda: DISK.rotation_fold(),
    "Disk.scene": lambda: DISK.scene("d"),
    "Disk.slow_manifold": lambda: DISK.slow_manifold(1),
    "Disk.speed": lambda: DISK.speed(above_het="1e-3"),
    "Certifier.near_omega_h": lambda: DISK.certify.near_omega_h("1e-9", near="30.2", digits=4),
    "Certifier.branch": lambda: _certified(DISK.certify.branch("0.05")),
    "Certifier.equilibrium": lambda: DISK.certify.equilibrium("inverted", "30.4"),
    "Certifier.fold": lambda: DISK.certify.fold(),
    "Certifier.heteroclinic": lambda: _certified(DISK.certify.heteroclinic(digits=3)),
    "Certifier.hopf": lambda: DISK.certify.hopf(),
    "Certifier.limit_cycle": lambda: _certified(DISK.certify.limit_cycle("30.8")),
    "Certifier.stability": lambda: DISK.certify.stability(),
    "Solution.__call__": lambda: DISK.integrate("30.4", START, 2)([0.1, 1.3]),
    "Solution.message Solution.plot Solution.to_dataframe Solution.success": lambda: _asked(
        DISK.integrate("30.4", START, 1), "message", "plot", _framed, "success"
    ),
    "Solution.save": lambda: _loaded(DISK.integrate("30.4", START, 1, digits=20)).to_dict(),
    "Solution.t_events Solution.y_events": lambda: _asked(
        DISK.integrate("30.4", START, 2, events="turn"), "t_events", "y_events"
    ),
    "Solution.to_dict": lambda: DISK.integrate(
        "30.4", START, 2, variations=("state", "omega")
    ).to_dict(),
    "shoot_limit_cycle Cycle.__call__ Cycle.orbit Cycle.multipliers Cycle.floquet_vectors": lambda: (
        _asked(
            tv.shoot_limit_cycle(DISK, "30.4", tv.Taylor()),
            *(lambda cycle: cycle, lambda cycle: cycle([0.1, 1.3])),
            *(lambda cycle: cycle.orbit(20), "multipliers", "floquet_vectors"),
        )
    ),
    "Cycle.monodromy Cycle.plot Cycle.save": lambda: _asked(
        DISK.limit_cycle("30.4"), "monodromy", "plot", _loaded
    ),
    "Cycle.sensitivity": lambda: DISK.limit_cycle("30.4").sensitivity,
    "load": lambda: _loaded(DISK.limit_cycle("30.4", digits=20)),
    "Disk.branch Branch.missing Branch.stable Branch.plot Branch.to_dict": lambda: _asked(
        DISK.branch(["30.4", "31"]), lambda branch: branch, "missing", "stable", "plot", "to_dict"
    ),
    "Branch.of Branch.points Branch.restart Branch.to_dataframe": lambda: _asked(
        DISK.branch(["30.4"]),
        *(lambda branch: branch.of([DISK.limit_cycle("30.5")]), "points"),
        *(lambda branch: branch.restart("Omega_crit", 3), _framed),
    ),
    "race": lambda: [
        one.error
        for one in tv.race({}, problems=["transient"], against=["taylor"], progress=False).scores
    ],
    "Heteroclinic.orbit Heteroclinic.samples": lambda: _asked(
        DISK.heteroclinic(),
        *(lambda connection: connection.orbit(20), lambda connection: connection.samples(20)),
    ),
    "BasinBoundary.margin BasinBoundary.sheets": lambda: _asked(
        DISK.basin_boundary("31.4"),
        *(lambda basin: basin.margin((1.5, 1, 0)), lambda basin: basin.sheets(1.0, 0.0)),
    ),
    "Measured.compared": lambda: tv.Measured.compared("0.1", "0.100001", tv.DOUBLE.epsilon),
    "Measured.contains": lambda: tv.Measured.of(1, "0.1").contains(tv.Measured.of(1, "0.01")),
    "Measured.decimals": lambda: tv.Measured.of("1/3", "1e-300").decimals(),
    "Measured.holds": lambda: tv.Measured.of(1, "0.1").holds("1.05"),
    "Measured.is_measured": lambda: tv.Measured.of(1, "0.1").is_measured,
    "Measured.without_half_width": lambda: str(tv.Measured.without_half_width("1/3", 20)),
    "Measured.of": lambda: [
        tv.Measured.of("2.5", "1e-9") ** 0.5,
        np.sqrt(tv.Measured.of("2.5", "1e-9")),
    ],
    "Measured.to_dict": lambda: tv.Measured.of("1/3", "1e-9").to_dict(),
    "Taylor.builds": lambda: tv.Taylor().builds,
    "ScipyEngine.name": lambda: tv.ScipyEngine().name,
    "Taylor.__call__": lambda: (
        tv.Taylor()(tv.Request(DISK, "30.4", START, 1, error_estimate=True)).state
    ),
    "ScipyEngine.__call__": lambda: tv.ScipyEngine()(tv.Request(DISK, "30.4", START, 1)).state,
    "BatchTaylor.__call__": lambda: tv.BatchTaylor(1)(
        _CONSTANTS, [30.4], [[1.5, 1.6, 0.0]], [1.0], divergence=True
    ),
    **{line: partial(ran, line.split()) for line in COMMANDS},
}

#: The minutes of what takes longer than a second or two.
SLOW = {
    "Certifier.branch": 0.5,
    "Disk.sensitivity": 0.3,
    "Disk.rotation_fold": 0.3,
    "Cycle.sensitivity": 0.2,
    "Certifier.limit_cycle": 0.2,
    "analyse_slow_manifold": 0.15,
    "Heteroclinic.orbit Heteroclinic.samples": 0.15,
    "cycle_above_omega_h": 0.1,
    "Disk.near_heteroclinic": 0.1,
    "race": 0.1,
    "Certifier.heteroclinic": 0.1,
    "Disk.slow_manifold": 0.1,
    "Solution.to_dict": 0.1,
    "Certifier.near_omega_h": 0.1,
    "Taylor.__call__": 0.1,
    "Disk.speed": 0.1,
    "Disk.harmonic_balance": 0.05,
    "heteroclinic": 0.05,
}
#: What takes longer than a fifth of a second.
LONG = (
    *SLOW,
    "collocation_cycle",
    "bisect_omega_h",
    "grade",
    "Disk.basin_boundary",
    "Disk.folds",
    "Disk.heteroclinic",
    "Disk.integrate",
    "Disk.limit_cycle",
    "Disk.rotating_branch",
    "Disk.rotating_cycle",
    "Disk.scene",
    "BasinBoundary.margin BasinBoundary.sheets",
    "Certifier.fold",
    "Solution.save",
    *(name for name in CALLS if name.startswith("Solution.message")),
    *(
        name
        for name in CALLS
        if any(kind in name for kind in ("Cycle.", "Branch.")) and name not in SLOW
    ),
    "load",
)


COMPUTING = tuple(
    f"tippedisk_verify.{name}."
    for name in ("model", "theory", "flow", "cycles", "connection", "proofs")
)


def computed(name: str) -> str:
    """The result of a call as text, with nothing kept from calls before but compiled code."""
    for module in [module for path, module in sys.modules.items() if path.startswith(COMPUTING)]:
        for item in vars(module).values():
            for kept in (item, getattr(item, "__wrapped__", None)):
                # heyoka itself stays: with it comes a check of all compiled code
                if isinstance(kept, _lru_cache_wrapper) and kept is not heyoka_module:
                    kept.cache_clear()
    locator._LOCATORS.locators.clear()
    return as_text(CALLS[name]())


# ---------------------------------------------------------------------------- what a caller may set
_SIGNALS = (
    *(decimal.Inexact, decimal.Rounded, decimal.Subnormal, decimal.Clamped, decimal.FloatOperation),
    *(decimal.InvalidOperation, decimal.DivisionByZero, decimal.Overflow, decimal.Underflow),
)


def _decimals(traps: Sequence[Any]) -> Any:
    small = decimal.Context(
        3, decimal.ROUND_UP, Emin=-5, Emax=5, capitals=0, clamp=1, flags=[], traps=list(traps)
    )
    return decimal.localcontext(small)


@contextlib.contextmanager
def _changed(*changes: tuple[Any, str, Any]) -> Iterator[None]:
    """Set attributes of the contexts of other libraries, given as owner, name and value."""
    with pytest.MonkeyPatch.context() as patch:
        for change in changes:
            patch.setattr(*change)
        yield


@contextlib.contextmanager
def _short_integers() -> Iterator[None]:
    before = sys.get_int_max_str_digits()
    sys.set_int_max_str_digits(640)
    try:
        yield
    finally:
        sys.set_int_max_str_digits(before)


@contextlib.contextmanager
def _decimal_commas() -> Iterator[None]:
    before = locale.setlocale(locale.LC_ALL)
    with contextlib.suppress(locale.Error):  # where the machine has none
        locale.setlocale(locale.LC_ALL, "de_DE.UTF-8")
    try:
        yield
    finally:
        locale.setlocale(locale.LC_ALL, before)


def _fail(*_: Any) -> None:
    raise FloatingPointError


STATES: dict[str, Callable[[], Any]] = {
    "NumPy raises": lambda: np.errstate(all="raise"),
    "NumPy calls": lambda: np.errstate(all="call", call=_fail),
    "NumPy prints": lambda: np.printoptions(precision=2, suppress=True, legacy="1.13"),
    "decimals that trap": lambda: _decimals(_SIGNALS),
    "decimals that trap nothing": lambda: _decimals(()),
    "mpmath": lambda: _changed(
        (mpmath.mp, "prec", 7), (mpmath.mp, "pretty", True), (mpmath.iv, "prec", 7)
    ),
    "gmpy2": lambda: gmpy2.context(
        precision=5,
        round=gmpy2.RoundUp,
        emax=9,
        emin=-9,
        trap_inexact=True,
        trap_underflow=True,
        trap_invalid=True,
    ),
    "python-flint": lambda: _changed(
        (flint.ctx, "prec", 12), (flint.ctx, "pretty", False), (flint.ctx, "unicode", True)
    ),
    "short integers": _short_integers,
    "warnings": lambda: warnings.catch_warnings(action="error"),
    "decimal commas": _decimal_commas,
}


def snapshot() -> str:
    """All that `STATES` can set, and the random generators."""
    numpy_s = np.geterr(), np.geterrcall(), np.get_printoptions(), np.random.get_state()
    decimals = repr(decimal.getcontext())
    wide = mpmath.mp.prec, mpmath.mp.pretty, mpmath.iv.prec, gmpy2.get_context()
    balls = flint.ctx.prec, flint.ctx.pretty, flint.ctx.unicode
    python_s = (
        sys.get_int_max_str_digits(),
        warnings.filters,
        locale.setlocale(locale.LC_ALL),
        random.getstate(),
    )
    return repr((numpy_s, decimals, wide, balls, python_s))


if __name__ == "__main__":
    print(json.dumps({name: computed(name) for name in CALLS if name not in LONG}))
