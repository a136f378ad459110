"""The result of `Disk.integrate`: a motion in the form of SciPy's solutions, with half-widths."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from os import PathLike
from pathlib import Path
from typing import Any, NamedTuple

import numpy

from tippedisk_verify.display import Printable, data_frame, numbers_as_json
from tippedisk_verify.errors import InputError
from tippedisk_verify.flow.contract import Engine, EventRecord, Request, Status
from tippedisk_verify.model.equations import STATE_NAMES
from tippedisk_verify.model.parameters import Parameters
from tippedisk_verify.motion.times import decimal_time, since_start
from tippedisk_verify.numbers.arrays import numpy_safe, round_to_doubles
from tippedisk_verify.numbers.exact import Exact, as_list, exact, fraction
from tippedisk_verify.numbers.precision import DOUBLE, DOUBLE_DIGITS

__all__ = ["Derivative", "Solution"]

_PLOTTED = 4001  # the number of times in a plot


class Derivative(NamedTuple):
    """The derivative of a motion with respect to one variable at fixed times, in SI units, with
    half-widths.
    """

    end: Any  #: (3,) of the end's beta, gamma [rad] and v [rad/s]
    end_uncertainty: Any  #: (3,)
    y: Any  #: (3, n) of the states, as in `Solution.y`
    uncertainty: Any  #: (3, n)


@dataclass(frozen=True, eq=False, repr=False)
class Solution(Printable):
    """A computed motion, with the attributes of a result of `scipy.integrate.solve_ivp` and a
    half-width for each number.

    - ``t`` (n,) [s] are the requested times that were reached, rounded once. ``times`` are the
      exact ones.
    - ``y`` (3, n) are the states at the exact times, with rows beta, gamma [rad] and v [rad/s].
    - ``uncertainty`` (3, n) are their half-widths, infinite where rounding decides how the run
      ends.
    - ``end`` is the end of the run. It lies before the final time if the disk lies flat or a
      terminal event ends the run, as ``status`` and ``message`` report.
    - ``events`` are the recorded crossings. Like ``end`` they have half-widths of their time and
      state.
    - ``by["mu"]`` is the derivative of the end and of the states with respect to mu, a
      `Derivative`. The other keys are omega, the other parameters, and the start's beta, gamma and
      v, as far as ``variations`` asked for them.
    - ``transition`` (3, 3) is the derivative of the end's state with respect to the start's, and
      ``by_omega`` (3,) [s] that with respect to the speed (rows as in ``y``). Both are taken at a
      fixed time, and are None unless ``variations`` asked for them.

    Up to 12 digits the numbers are doubles, up to 16 numpy.longdouble, and beyond that arrays of
    objects, heyoka's numbers: ``y.astype(float)`` rounds them to doubles.
    """

    disk: Parameters
    omega: object  #: [rad/s]
    t: Any
    y: Any
    uncertainty: Any
    status: Status
    end: EventRecord
    events: tuple[EventRecord, ...]
    transition: Any
    transition_uncertainty: Any
    by_omega: Any
    by_omega_uncertainty: Any
    by: Mapping[str, Derivative]
    engine: str
    precision: str
    times: Sequence[Exact]  #: the exact times that ``t`` rounds [s]
    note: str  #: a warning about the numbers, or an empty text
    _event_names: tuple[str, ...]  # the names of the requested events
    _start: Exact
    _end_time: Exact  # the requested end of the run [s]
    _request: Request | None  # None if the solution was loaded, as is the engine
    _engine: Engine | None

    def __getstate__(self) -> dict[str, Any]:
        """Return the state to pickle or copy, without continuous output.

        The copy computes continuous output again, by a run that needs no events.
        """
        kept = {name: value for name, value in self.__dict__.items() if name != "_dense"}
        request = self._request and replace(self._request, events=(), times=None)
        return kept | {"_request": request}

    @property
    def success(self) -> bool:
        """True if the run ended as requested, or at the end of the model's domain."""
        return self.status.usable

    @property
    def message(self) -> str:
        """The end of the run in words, with any warning."""
        return f"{self.status.value}; {self.note}" if self.note else self.status.value

    @property
    def t_events(self) -> list[Any]:
        """The times (k,) [s] of the crossings of each requested event."""
        return [
            numpy_safe(numpy.array([record.time for record in self._crossings_of(name)]))
            for name in self._event_names
        ]

    @property
    def y_events(self) -> list[Any]:
        """The states (k, 3) at the crossings of each requested event."""
        return [
            numpy_safe(
                numpy.array([record.state for record in self._crossings_of(name)]).reshape(-1, 3)
            )
            for name in self._event_names
        ]

    def _crossings_of(self, name: str) -> list[EventRecord]:
        return [record for record in self.events if record.name == name]

    @property
    def _engine_and_request(self) -> tuple[Engine, Request]:
        if self._request is None or self._engine is None:
            raise InputError(
                "a loaded solution has its samples only: integrate again for other times"
            )
        return self._engine, self._request

    @cached_property
    def _dense(self) -> Any:
        engine, request = self._engine_and_request
        result = engine(
            replace(request, dense=True, times=None, variations=(), error_estimate=False)
        )
        if result.dense is None:
            raise InputError(f"{self.engine} gives no continuous output")
        return result.dense

    def __call__(self, t: Any) -> Any:
        """Return the motion's state (3,) at a time, or its states (3, n) at times (n,).

        They have the integrator's accuracy or the requested digits. The first call repeats the run
        with continuous output.

        Args:
            t: A time or times [s].

        Raises:
            InputError: If a time lies outside the run, or the solution was loaded.
        """
        (engine, request), asked = self._engine_and_request, as_list(t)
        end = self._end_time if self.status is Status.REACHED else exact(self.end.time)
        _, times = since_start(self._start, end, asked)
        since, length = DOUBLE.array(times), float(end - self._start)
        if (since * length < 0).any() or (abs(since) > abs(length)).any():
            first, last = sorted((float(self._start), float(end)))
            raise InputError(f"the solution is known from {first:.10g} s to {last:.10g} s")
        if request.digits > DOUBLE_DIGITS:  # the error at each time is removed
            _, first_of, places = numpy.unique(abs(since), return_index=True, return_inverse=True)
            wanted = replace(request, times=[times[n] for n in first_of], events=(), variations=())
            states = engine(wanted).samples.T[:, places]
        else:
            states = self._dense(request.precision.array(times)).T
        states = numpy_safe(states)
        return states if numpy.ndim(t) else states[:, 0]

    def plot(self, axes: Any = None) -> Any:
        """Plot beta, gamma and v against the time, with the recorded events as dots.

        A loaded solution is plotted at its samples only.

        Args:
            axes: Three matplotlib axes; None for new ones, one below the other.

        Returns:
            The matplotlib figure.
        """
        if axes is None:
            from matplotlib import pyplot

            figure, axes = pyplot.subplots(3, sharex=True, layout="constrained")
            figure.suptitle(
                f"{self.disk.name}, {self.disk.law} friction, Ω = {float(fraction(self.omega)):.10g} rad/s"
            )
        times, states = round_to_doubles(self.t), round_to_doubles(self.y)
        if self._request is not None and times.size:
            times = numpy.linspace(times[0], times[-1], _PLOTTED)
            states = round_to_doubles(self(times))
        names = dict.fromkeys(event.name for event in self.events)
        labels = ("β [rad]", "γ [rad]", "v = dβ/dt [rad/s]")
        for row, (axis, label) in enumerate(zip(axes, labels, strict=True)):
            axis.plot(times, states[row])
            for name in names:
                events = [event for event in self.events if event.name == name]
                moments = [float(event.time) for event in events]
                axis.plot(moments, [float(event.state[row]) for event in events], ".", label=name)
            axis.set(ylabel=label)
        if names:
            axes[0].legend(loc="lower right", bbox_to_anchor=(1, 1), ncols=len(names))
        axes[-1].set(xlabel="t [s]")
        return axes[-1].figure

    def save(self, path: str | PathLike[str]) -> Path:
        """Write the solution as JSON in which every number is exact; `tippedisk_verify.load` reads
        it.

        The file is described in `tippedisk_verify.model.result_format`. Its keys are the
        attributes' names; ``t`` has the exact times. A loaded solution has its samples, events and
        derivatives, but no continuous output: ``solution(t)`` is refused.

        Args:
            path: The file; its name ends in ".json".

        Returns:
            The path of the file written.

        Raises:
            InputError: If the friction law is a user's own, a state is not finite, or the file
                cannot be written.
        """
        from tippedisk_verify.motion.saved_results import save_solution

        return save_solution(self, path)

    def to_dataframe(self) -> Any:
        """Return a pandas data frame of the samples, with the columns that `integrate --out`
        writes.

        They are ``t``, the rows of ``y`` as beta, gamma and v, and those of ``uncertainty`` as
        beta_uncertainty and so on.

        Raises:
            InputError: If pandas is not installed.
        """
        widths = (f"{name}_uncertainty" for name in STATE_NAMES)
        names = ("t", *STATE_NAMES, *widths)
        return data_frame(dict(zip(names, (self.t, *self.y, *self.uncertainty), strict=True)))

    def to_dict(self) -> dict[str, Any]:
        """Return the motion as data for JSON: times and states with half-widths, the end, the
        events and the derivatives.

        The command line prints this data as JSON.
        """
        derivatives = (
            ("transition", self.transition, self.transition_uncertainty),
            ("by_omega", self.by_omega, self.by_omega_uncertainty),
        )
        return {
            "status": self.status.name.lower(),
            "message": self.message,
            "end": self._end_entries(),
            "t": [decimal_time(time) for time in self.times],
            **dict(zip(STATE_NAMES, numbers_as_json(self.y, self.uncertainty), strict=True)),
            "events": [event.to_dict() for event in self.events],
            **{
                name: numbers_as_json(values, widths)
                for name, values, widths in derivatives
                if values is not None
            },
            "derivatives": {
                name: {
                    "end": numbers_as_json(slope.end, slope.end_uncertainty),
                    **dict(
                        zip(STATE_NAMES, numbers_as_json(slope.y, slope.uncertainty), strict=True)
                    ),
                }
                for name, slope in self.by.items()
            },
        }

    def _end_entries(self) -> dict[str, Any]:
        """Return the end of the motion as data for JSON; the time is exact if the run reached its
        final time.
        """
        entries = {name: entry for name, entry in self.end.to_dict().items() if name != "name"}
        if self.status is Status.REACHED:
            entries["t"] = {"value": decimal_time(self._end_time), "uncertainty": "0"}
        return entries
