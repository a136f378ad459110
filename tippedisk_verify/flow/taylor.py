"""heyoka's Taylor integrator as an engine: it chooses the stepper of a request and the way to its
half-widths.

Each request is served by a compiled integrator: the bare field, the field with the requested
events, or the variational system for the requested derivatives, in the requested arithmetic. It is
compiled once and kept until a hundred others have been used since. All parameters are runtime
values, so one build serves every parameter set and speed. `Taylor.builds` lists the integrators
that are kept.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy

from tippedisk_verify.errors import InputError
from tippedisk_verify.flow import default_engine
from tippedisk_verify.flow.compiled_runners import CompiledRunners
from tippedisk_verify.flow.contract import FLAT, Build, Request, Result, Status
from tippedisk_verify.flow.start import starts_at_rest, starts_on_a_surface
from tippedisk_verify.flow.stepper import CompiledStepper
from tippedisk_verify.numbers.arrays import round_to_doubles
from tippedisk_verify.numbers.numpy_errors import ignore_numpy_errors_in_methods
from tippedisk_verify.numbers.precision import (
    DOUBLE,
    DOUBLE_DIGITS,
    bits_for_digits,
    precision_of_bits,
)

__all__ = ["Taylor"]

# The digits to which a run is corrected if its start, as a double, lies on an event's surface.
_SURFACE_DIGITS = 20


@ignore_numpy_errors_in_methods
class Taylor:
    """The Taylor engine: it integrates by Taylor series of the order that the tolerance requires,
    in any precision.

    Threads may share an instance: a run waits until the integrator that it needs is free. They are
    faster with one instance each (`flow.default_engine`). The tolerance belongs to the run: it is
    ``rtol`` of `Disk.integrate`, and ``tolerance`` of a `Request`.

    Args:
        high_accuracy: Compensate the summation of the series. Over tens of seconds it changes the
            error little here, because the rounding of the inputs dominates.
        fast_math: Let the compiler reorder sums. In double this saves a tenth of the run time with
            4 SIMD lanes and a fifth with 8, but last digits then depend on the processor.
        compact: Override the measured choice between unrolled code (double: half the run time) and
            loops (above double, where unrolled code would take minutes to compile).

    Raises:
        InputError: If both ``high_accuracy`` and ``fast_math`` are chosen.
    """

    name = "taylor"  #: the name of this engine in results
    measures_error = True  #: this engine can give half-widths of its results

    def __init__(
        self,
        *,
        high_accuracy: bool = False,
        fast_math: bool = False,
        compact: bool | None = None,
    ) -> None:
        if high_accuracy and fast_math:
            raise InputError(
                "fast_math would reorder the sums that high_accuracy compensates: choose one"
            )
        self._options: dict[str, Any] = {"high_accuracy": high_accuracy, "fast_math": fast_math}
        self._compact = compact
        self._integrators = CompiledRunners()

    def __reduce_ex__(self, protocol: Any) -> Any:
        """Pickle the default engine as the default engine of the other process."""
        return (default_engine, ()) if self is default_engine() else super().__reduce_ex__(protocol)

    @property
    def builds(self) -> tuple[Build, ...]:
        """The integrators that this engine has compiled and still keeps, in order."""
        return tuple(integrator.build for integrator in self._integrators.kept())

    def __call__(self, request: Request) -> Result:
        """Integrate the motion that a request describes, by Taylor series.

        Args:
            request: The run.

        Returns:
            The result, with half-widths if the request asks for them.

        Raises:
            InputError: If the start, the duration or the speed is not a finite number. Also if the
                start is so close to the floor that rounding decides whether the disk leaves it.
        """
        if request.events and starts_at_rest(request):
            return self(replace(request, events=()))
        events = request.events
        if request.domain == "event" and FLAT not in events:
            events = (*events, FLAT)
        shape = (request.shifted, request.variations, request.divergence, events)
        key = (request.precision, request.law, request.tolerance, *shape)
        compact = self._compact if self._compact is not None else request.precision != DOUBLE
        with self._integrators.reserved(
            key, lambda: CompiledStepper(request, events, self._options, compact)
        ) as stepper:
            result: Result = stepper.run(request)
        if request.domain == "samples" and _leaves_domain(request, result):
            # This is rare. Only now is the event worth compiling, and only it finds the time.
            return self(replace(request, domain="event"))
        if request.domain == "event" and _leaves_domain(request, result):
            raise InputError(
                "this start is so close to the floor that rounding decides whether "
                "the disk leaves it"
            )
        return self._with_error(request, result) if request.error_estimate else result

    def _with_error(self, request: Request, result: Result) -> Result:
        """Return the result of a run with half-widths, from its defect or else from a run in wider
        arithmetic.

        A run that stopped early gets no half-widths. Where doubles give none because the start lies
        on an event's surface up to rounding, the run is corrected in wider arithmetic.
        """
        if not result.status.usable:
            return result._replace(series=None)
        from tippedisk_verify.flow.half_widths_by_defect import half_widths_from_defect

        refined = half_widths_from_defect(request, result)
        if refined is None and request.digits > DOUBLE_DIGITS:
            precision = precision_of_bits(bits_for_digits(request.digits + 8))
            wide = replace(request, precision=precision, tolerance=None, digits=DOUBLE_DIGITS)
            return self(wide)._replace(precision=precision)
        if refined is None:
            from tippedisk_verify.flow.half_widths_by_wider_run import half_widths_from_wider_run

            refined = half_widths_from_wider_run(self, request, result)
            assert refined.error is not None
            if math.isinf(refined.error.time) and request.events and starts_on_a_surface(request):
                refined = (
                    half_widths_from_defect(replace(request, digits=_SURFACE_DIGITS), result)
                    or refined
                )
        return refined._replace(series=None)


def _leaves_domain(request: Request, result: Result) -> bool:
    """Return True if the end or a sample of a run has sin(beta) <= 0, where the model does not
    hold.
    """
    if not result.status.usable or result.status is Status.FLAT:
        return False
    # The angle lies far enough from the edge that the float's sign is the number's.
    angles: Any = [] if result.samples is None else round_to_doubles(result.samples[:, 0])
    sine = numpy.cos if request.shifted else numpy.sin
    return bool((sine(numpy.append(angles, float(result.state[0]))) <= 0).any())
