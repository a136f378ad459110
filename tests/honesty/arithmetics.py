"""Arithmetics that stand for other processors: what holds by luck of this one's roundings does not
hold in them.

Another processor sums in another order, fuses multiplications or not, holds more or fewer lanes in
a register, and ends in another last bit. Claims are computed inside one of these, truths outside.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any
from unittest import mock

import numpy

from tippedisk_verify import BatchTaylor, Taylor, flow
from tippedisk_verify.flow.jit import heyoka_module

#: Integrators are built where these names are looked up.
_BUILDERS = (
    "tippedisk_verify.flow.stepper.heyoka_module",
    "tippedisk_verify.flow.batch.heyoka_module",
)


class Machine:
    """heyoka as another processor has it: a module whose integrators are built, and step, in
    another way.

    ``options`` are heyoka's, for every integrator, and ``width`` is the number of lanes of a batch.
    """

    def __init__(self, options: dict[str, Any] | None = None, width: int | None = None) -> None:
        self._heyoka, self._options, self._width = heyoka_module(), options or {}, width
        self.engine, self.batch_engine = Taylor(), BatchTaylor(width)
        self.moves, self.random = 0, numpy.random.default_rng()

    def __getattr__(self, name: str) -> Any:
        return getattr(self._heyoka, name)

    def recommended_simd_size(self) -> int:
        return self._width or int(self._heyoka.recommended_simd_size())

    def taylor_adaptive(self, *args: Any, **asked: Any) -> Any:
        return self._stepping(
            self._heyoka.taylor_adaptive(*args, **{**asked, **self._options}), asked
        )

    def taylor_adaptive_batch(self, *args: Any, **asked: Any) -> Any:
        return self._stepping(
            self._heyoka.taylor_adaptive_batch(*args, **{**asked, **self._options}), asked
        )

    def _stepping(self, stepper: Any, asked: dict[str, Any]) -> Any:
        in_double = asked.get("fp_type", float) is float
        return (
            _Stepper(stepper, self, self._after_a_step(stepper.state.ndim > 1))
            if in_double
            else stepper
        )

    def moved(self, values: Any) -> Any:
        """Each number with up to ``moves`` units in its last place more or less; what is zero
        stays zero.
        """
        units = self.random.integers(-self.moves, self.moves, size=values.shape, endpoint=True)
        return numpy.where(values == 0, values, values + units * numpy.spacing(numpy.abs(values)))

    def _after_a_step(self, batch: bool) -> Callable[[Any], bool]:
        """What heyoka calls after every step: a plain function, because it copies whatever
        else it is given.
        """
        before: list[Any] = [None]

        def after(stepper: Any) -> bool:
            # A lane that has arrived waits for the others, and takes no step
            now = numpy.array(stepper.time)
            going = now != before[0] if batch and before[0] is not None else slice(None)
            before[0] = now
            stepper.state[..., going] = self.moved(stepper.state[..., going])
            return True

        return after


class _Stepper:
    """An integrator whose numbers move after every step, while its machine moves any; in all
    else the integrator.
    """

    def __init__(self, *parts: Any) -> None:
        object.__setattr__(self, "_parts", parts)

    def __getattr__(self, name: str) -> Any:
        stepper, machine, after = self._parts
        found = getattr(stepper, name)
        if name not in ("propagate_until", "propagate_grid") or not machine.moves:
            return found

        def propagate(*args: Any, callback: Any = None, **options: Any) -> Any:
            return found(
                *args, callback=[*([] if callback is None else [callback]), after], **options
            )

        return propagate

    def __setattr__(self, name: str, value: Any) -> None:
        setattr(self._parts[0], name, value)


@dataclass(frozen=True)
class Arithmetic:
    """One way to compute what is claimed."""

    name: str
    machine: Machine
    #: After every step each double moves by up to so many units in its last place, at random
    last_bits: int = 0

    @contextmanager
    def active(self, seed: str) -> Iterator[None]:
        """Whatever is built and flown meanwhile is of this arithmetic; ``seed`` is that of
        the moved bits.
        """
        here = self.machine
        here.random = numpy.random.default_rng(list(seed.encode()))
        first, second = (mock.patch(name, return_value=here) for name in _BUILDERS)
        engines = mock.patch.multiple(
            flow._THREAD_ENGINES, engine=here.engine, batch_engine=here.batch_engine, create=True
        )
        with first, second, engines, mock.patch.object(here, "moves", self.last_bits):
            yield


_HERE = Machine()
DEFAULT = Arithmetic("default", _HERE)
MOVED_BITS = Arithmetic("moved bits", _HERE, last_bits=2)
OTHER_ORDER = Arithmetic("sums in any order, two lanes", Machine({"fast_math": True}, width=2))
