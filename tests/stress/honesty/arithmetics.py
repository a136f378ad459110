"""Arithmetics that stand for other processors, on one machine.

Another processor rounds otherwise: its compiler orders sums in another way, its registers hold more or fewer lanes, its
mathematical library ends in another last bit, it may have no extended precision. Each `Arithmetic` here makes this
machine do one of these things, or moves last bits at random (stochastic arithmetic), or takes other steps. What is
claimed is computed inside one of them, and the truth outside: an uncertainty that does not hold in one of them does not
hold.

What heyoka's options cannot change is the set of instructions: on Intel's processors it leaves AVX-512 registers alone
unless they are forced, on AMD's it always takes them, and the numbers of lanes stand for the difference. Its option
``code_model`` places code in memory and changes no number.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any
from unittest import mock

import numpy

from tippedisk_verify.flow.contract import Request, Result
from tippedisk_verify.flow.lanes import BatchTaylor
from tippedisk_verify.flow.taylor import Taylor
from tippedisk_verify.model import precision
from tippedisk_verify.model.precision import DOUBLE, heyoka_module

__all__ = ["ARITHMETICS", "DEFAULT", "Arithmetic", "arithmetic_named"]

#: Integrators are built where these names are looked up.
_BUILDERS = ("tippedisk_verify.flow.compiled.heyoka_module", "tippedisk_verify.flow.lanes.heyoka_module")
_KINDS = {float: "double", numpy.longdouble: "extended"}


@dataclass(frozen=True, eq=False)
class Arithmetic:
    """One way to compute what is claimed."""

    name: str
    says: str
    options: Mapping[str, Any] = field(default_factory=dict)  #: of heyoka, for every integrator
    in_double: Mapping[str, Any] = field(default_factory=dict)  #: the same for doubles only
    tolerance: float | None = None  #: in units of round-off, for requests that name none
    short_steps: bool = False  #: no step is longer than about half of what it would be
    last_bits: int = 0  #: after every step each number moves by up to so many units in its last place, at random
    moved: tuple[str, ...] = ("double",)  #: the precisions in which it does
    width: int | None = None  #: lanes of a batch
    extended: bool = True  #: whether there are x87's numbers, which wider runs then take
    environment: Mapping[str, str] = field(default_factory=dict)  #: what a process must be started with

    @property
    def lanes_only(self) -> bool:
        """Whether it differs from the default in nothing but what runs in lanes."""
        return self.width is not None

    @property
    def here(self) -> bool:
        """Whether this process computes in it."""
        return all(os.environ.get(name) == value for name, value in self.environment.items())

    @cached_property
    def engine(self) -> Taylor:
        return Taylor()

    @cached_property
    def lanes(self) -> BatchTaylor:
        return BatchTaylor(self.width)

    @cached_property
    def _machine(self) -> _Machine:
        return _Machine(self)

    @contextmanager
    def active(self, seed: object = 0) -> Iterator[Arithmetic]:
        """Whatever is built meanwhile, is built for this arithmetic; ``seed`` is that of the moved bits."""
        if not self.here:
            raise RuntimeError(f"'{self.name}' needs a process of its own, started with {dict(self.environment)}")
        self._machine.begin(seed)
        with ExitStack() as changes:
            for name in _BUILDERS:
                changes.enter_context(mock.patch(name, return_value=self._machine))
            if not self.extended:
                changes.enter_context(mock.patch.object(precision, "_has_extended", return_value=False))
            if self.short_steps:
                changes.enter_context(
                    mock.patch.object(Taylor, "__call__", self._machine.in_short_steps(Taylor.__call__))
                )
            yield self


class _Machine:
    """heyoka as another processor has it: a module whose integrators are built, and step, in another way."""

    def __init__(self, arithmetic: Arithmetic) -> None:
        self._heyoka, self._arithmetic = heyoka_module(), arithmetic
        self.longest: float | None = None  #: step [s]
        self.begin(0)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._heyoka, name)

    def begin(self, seed: object) -> None:
        self._random = numpy.random.default_rng(list(str(seed).encode()))

    def in_short_steps(self, run: Callable[[Taylor, Request], Result]) -> Callable[[Taylor, Request], Result]:
        """Steps are left to heyoka up to some length, which follows from the disk."""

        def limited(engine: Taylor, request: Request) -> Result:
            p = request.parameters
            decay = float(p.mu * p.g / p.epsilon * (p.r + p.e) ** 2 * p.m / p.Bbar)  # of sliding [1/s]
            rate = max(decay + abs(float(DOUBLE.number(request.omega))), 1e-30)
            # Steps of full length fall like the root of that rate, and above 1e3 like its inverse: half of those.
            self.longest = min(0.07 / rate**0.5, 4 / rate)
            return run(engine, request)

        return limited

    def recommended_simd_size(self) -> int:
        return self._arithmetic.width or int(self._heyoka.recommended_simd_size())

    def taylor_adaptive(self, system: Any, start: Any, **asked: Any) -> Any:
        return self._stepping(self._heyoka.taylor_adaptive, system, start, asked)

    def taylor_adaptive_batch(self, system: Any, start: Any, **asked: Any) -> Any:
        return self._stepping(self._heyoka.taylor_adaptive_batch, system, start, asked)

    def _stepping(self, make: Callable[..., Any], system: Any, start: Any, asked: dict[str, Any]) -> Any:
        chosen, kind = self._arithmetic, asked.get("fp_type", float)
        options = {**asked, **chosen.options, **(chosen.in_double if kind is float else {})}
        if chosen.tolerance is not None and "tol" not in asked and kind in _KINDS:
            options["tol"] = kind(numpy.finfo(kind).eps) * kind(chosen.tolerance)
        stepper = make(system, start, **options)
        moves = chosen.last_bits if _KINDS.get(kind) in chosen.moved else 0
        return _Stepper(stepper, self, moves) if moves or chosen.short_steps else stepper

    def with_moved_bits(self, numbers: Any, most: int) -> Any:
        """Each number with up to so many units in its last place more or less; what is zero stays zero."""
        units = self._random.integers(-most, most, size=numbers.shape, endpoint=True)
        return numpy.where(numbers == 0, numbers, numbers + units * numpy.spacing(numpy.abs(numbers)))


class _Stepper:
    """An integrator whose numbers move after every step, or whose steps are short; in all else the integrator."""

    def __init__(self, stepper: Any, machine: _Machine, moves: int) -> None:
        after = _moving(machine, moves, stepper.state.ndim > 1) if moves else None
        for name, value in (("_stepper", stepper), ("_machine", machine), ("_after", after)):
            object.__setattr__(self, name, value)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stepper, name)

    def __setattr__(self, name: str, value: Any) -> None:
        setattr(self._stepper, name, value)

    def propagate_until(self, *args: Any, **options: Any) -> Any:
        return self._stepper.propagate_until(*args, **self._changed(options))

    def propagate_grid(self, *args: Any, **options: Any) -> Any:
        return self._stepper.propagate_grid(*args, **self._changed(options))

    def _changed(self, options: dict[str, Any]) -> dict[str, Any]:
        if self._after is not None:
            given = options.get("callback")
            options["callback"] = [*([] if given is None else [given]), self._after]
        if (longest := self._machine.longest) is not None:
            now = self._stepper.time
            options["max_delta_t"] = [longest] * len(now) if isinstance(now, numpy.ndarray) else type(now)(longest)
        return options


def _moving(machine: _Machine, most: int, batch: bool) -> Callable[[Any], bool]:
    """What heyoka calls after every step: a plain function, because it copies whatever else it is given."""
    before: list[Any] = [None]

    def after(stepper: Any) -> bool:
        stepper.state[:] = machine.with_moved_bits(stepper.state, most)
        return True

    def after_all(stepper: Any) -> bool:
        now = numpy.array(stepper.time)  # a lane that has arrived waits for the others, and takes no step
        going = numpy.full(now.shape, True) if before[0] is None else now != before[0]
        before[0] = now
        stepper.state[:, going] = machine.with_moved_bits(stepper.state[:, going], most)
        return True

    return after_all if batch else after


DEFAULT = Arithmetic("default", "as installed")

ARITHMETICS = (
    DEFAULT,
    Arithmetic("fast math", "sums in any order, with fused multiplications", {"fast_math": True}),
    *(Arithmetic(f"optimisation {n}", f"the compiler's level {n}", {"opt_level": n}) for n in (0, 1, 2)),
    *(Arithmetic(f"{n} lanes", f"{n} runs in one register", width=n) for n in (2, 4, 8)),
    Arithmetic("AVX-512", "the widest registers wherever there are some", {"force_avx512": True}),
    Arithmetic("packed", "scalar code packed into vectors", {"slp_vectorize": True, "force_avx512": True}),
    Arithmetic("compact", "loops instead of unrolled code", in_double={"compact_mode": True}),
    Arithmetic("compensated", "compensated sums of the series", {"high_accuracy": True}),
    Arithmetic("moved bits", "each number by up to two units in its last place, after every step", last_bits=2),
    Arithmetic("all bits moved", "by one unit, in extended precision too", last_bits=1, moved=("double", "extended")),
    Arithmetic("higher order", "a sixteenth of round-off as the tolerance: one order more", tolerance=2.0**-4),
    Arithmetic("lower order", "twice round-off as the tolerance: one order less", tolerance=2.0),
    Arithmetic("short steps", "steps of half their length", short_steps=True),
    Arithmetic("no x87", "no extended precision: wider runs are quadruple", extended=False),
    Arithmetic(
        "old libraries",
        "mathematical functions and linear algebra without fused multiplications and wide registers",
        environment={
            "GLIBC_TUNABLES": "glibc.cpu.hwcaps=-AVX2,-FMA,-FMA4,-AVX512F",
            "OPENBLAS_CORETYPE": "Nehalem",
            "NPY_DISABLE_CPU_FEATURES": "X86_V3 X86_V4 AVX512_ICL",
        },
    ),
)  # fmt: skip
_BY_NAME = {arithmetic.name: arithmetic for arithmetic in ARITHMETICS}


def arithmetic_named(name: str) -> Arithmetic:
    return _BY_NAME[name]
