"""The accuracy study next to Omega_h: periods, their law with its corrections, and other programs'
answers.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from typing import Any

from tippedisk_verify.cycles.cycle_at_speed import librating_cycle_at
from tippedisk_verify.cycles.near_omega_h.cycle_at_distance import cycle_above_omega_h
from tippedisk_verify.display import Printable, data_frame, quantity
from tippedisk_verify.errors import InputError
from tippedisk_verify.flow.contract import Engine
from tippedisk_verify.model.equations import checked_speed
from tippedisk_verify.model.parameters import Parameters
from tippedisk_verify.numbers.exact import as_list, fraction
from tippedisk_verify.numbers.measured import Measured
from tippedisk_verify.omega_h.period_law import PeriodLaw, period_law

__all__ = [
    "PERIOD_LAW_COLUMNS",
    "AnswerRow",
    "DistanceRow",
    "NearHeteroclinic",
    "near_heteroclinic",
]

#: The columns of `DistanceRow.law` in tables.
PERIOD_LAW_COLUMNS = ("law_of_one_term", "law_of_two_terms", "law_of_three_terms")


@dataclass(frozen=True, repr=False)
class DistanceRow(Printable):
    """The limit cycle at one distance above Omega_h, with the values of the period's law there."""

    distance: Measured = field(metadata=quantity("Omega - Omega_h", "rad/s"))
    omega: Measured = field(metadata=quantity("the spinning speed", "rad/s"))
    period: Measured = field(metadata=quantity("T, the period", "s"))
    law: tuple[Measured, Measured, Measured] = field(
        metadata=quantity("T by the law with one, two and three terms", "s")
    )
    multiplier_slow: Measured = field(
        metadata=quantity("the larger nontrivial Floquet multiplier", "1")
    )
    double_resolves: float = field(
        metadata=quantity("change of T by half a unit in the last place of Omega as a double", "s")
    )


@dataclass(frozen=True, repr=False)
class AnswerRow(Printable):
    """A period from another program, with that of the limit cycle at exactly the same speed."""

    omega: Measured = field(metadata=quantity("the spinning speed", "rad/s"))
    period_found: Measured = field(metadata=quantity("the other program's period", "s"))
    period: Measured = field(metadata=quantity("T, the period", "s"))
    error: Measured = field(metadata=quantity("the other program's period less T", "s"))


@dataclass(frozen=True, repr=False)
class NearHeteroclinic(Printable):
    """The study next to Omega_h: the law of the period, cycles, and other programs' answers.

    The law is T = slope log(D) + constant + coefficient D^exponent + ..., with D above Omega_h in
    rad/s. A fit of T against log(D) misses the slope by a relative error of about ``exponent *
    coefficient / slope * D^exponent``.
    """

    _max_list_entries = 60  # of the rows and of the answers

    period_law: PeriodLaw  #: the four numbers above
    rows: tuple[DistanceRow, ...]  #: in the order of the distances
    answers: tuple[AnswerRow, ...]  #: in the order of the answers
    parameters: Parameters  #: the disk, with the friction law
    engine: str  #: the engine that computed it

    def to_dataframe(self) -> Any:
        """Return a pandas data frame with a row for each distance, as `heteroclinic --near` writes
        them.

        Numbers are rounded to doubles; their half-widths, in NAME_uncertainty, include the
        rounding.

        Raises:
            InputError: If pandas is not installed.
        """
        rows = [
            vars(row) | dict(zip(PERIOD_LAW_COLUMNS, row.law, strict=True)) for row in self.rows
        ]
        return data_frame(rows).drop(columns="law")

    def plot(self, axes: Any = None) -> Any:
        """Plot the remainder of T after one, two and three terms of the law, against the distance.

        A dashed line shows the resolution of a double of Omega, down to the distance at which
        doubles no longer separate the speed from Omega_h. Crosses are the errors of the answers.

        Args:
            axes: The matplotlib axes; None for new ones.

        Returns:
            The matplotlib figure.
        """
        if axes is None:
            from matplotlib import pyplot

            _, axes = pyplot.subplots(layout="constrained")
        distances = [float(row.distance) for row in self.rows]
        for terms, name in enumerate(("one term", "two terms", "three terms")):
            left = [abs(float(row.period - row.law[terms])) for row in self.rows]
            axes.loglog(distances, left, ".-", label=f"error of the law with {name}")
        resolved = [
            row for row in self.rows if float(row.distance) > math.ulp(float(row.omega)) / 2
        ]
        axes.loglog(
            [float(row.distance) for row in resolved],
            [row.double_resolves for row in resolved],
            "k--",
            label="effect of half an ulp of Ω in double",
        )
        if self.answers:
            omega_h = self.rows[0].omega - self.rows[0].distance
            axes.loglog(
                [abs(float(answer.omega - omega_h)) for answer in self.answers],
                [abs(float(answer.error)) for answer in self.answers],
                "kx",
                label="error of the answers",
            )
        axes.set(
            title=f"{self.parameters.name}, {self.parameters.friction} friction law",
            xlabel=r"$\Omega - \Omega_h$ [rad/s]",
            ylabel="error of T [s]",
        )
        axes.grid(lw=0.3)
        axes.legend(fontsize="small")
        return axes.figure


def near_heteroclinic(
    parameters: Parameters,
    distances: object,
    engine: Engine,
    *,
    answers: Sequence[Sequence[object]] | None = None,
) -> NearHeteroclinic:
    """Return the accuracy study at these distances above Omega_h, each number to twelve digits.

    Args:
        parameters: The disk and its friction law.
        distances: The distances [rad/s], positive decimals.
        engine: The engine of the flights.
        answers: Pairs of a speed [rad/s] and the period [s] that a program found there. Each is
            taken as the exact decimal or double that it is.

    Raises:
        InputError: If a number is not a positive decimal, or an answer is not a pair.
        NoSuchCycleError: If there is no such cycle or law.
        NoConnectionError: If there is no connection.
        AccuracyError: If the digits are not reached.
    """
    pairs = list(answers or ())
    if any(isinstance(pair, str) or len(pair) != 2 for pair in pairs):
        raise InputError("an answer is a pair of a speed and a period, such as ('30.05', '5.27')")
    checked_answers = [(checked_speed(omega), fraction(period)) for omega, period in pairs]
    law = period_law(parameters, engine)
    rows = tuple(_row_at(parameters, distance, engine, law) for distance in as_list(distances))
    compared = tuple(_compared(parameters, *answer, engine) for answer in checked_answers)
    return NearHeteroclinic(law, rows, compared, parameters, engine.name)


def _row_at(
    parameters: Parameters, distance: object, engine: Engine, law: PeriodLaw
) -> DistanceRow:
    cycle = cycle_above_omega_h(parameters, distance, engine)
    exact = fraction(distance)
    return DistanceRow(
        distance=Measured(exact, Fraction(0)),
        omega=cycle.omega,
        period=cycle.period,
        law=law.at(exact),
        multiplier_slow=cycle.multiplier_slow,
        double_resolves=abs(float(cycle.dperiod_domega)) * math.ulp(float(cycle.omega)) / 2,
    )


def _compared(
    parameters: Parameters, omega: Fraction, answer: Fraction, engine: Engine
) -> AnswerRow:
    period = librating_cycle_at(parameters, omega, engine).period
    answered = Measured(answer, Fraction(0))
    return AnswerRow(Measured(omega, Fraction(0)), answered, period, answered - period)
