"""Which of the paper's printed numbers can follow from its Table 1, for every disk that rounds to that table.

The table's five quantities are known to half a unit of their last digit: a box of disks. mu = 0.3 and epsilon = 0.1 are
choices and exact; g is not printed and enters as the exact value given. The numbers looked at are monotone in each of
r, e, m, A and B over the box: the sign of each partial derivative is proved on balls that cover it. So each takes its
extremes at two corners, which are exact disks, and, being continuous, every value between. The first Lyapunov
coefficient is enclosed on balls that cover the box, bisected until each is negative.

Where a ball becomes a point here: `measured` hands out midpoints with their radii; which side to bisect is decided in
rational arithmetic and does not matter for what is proved.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, fields
from fractions import Fraction
from types import SimpleNamespace
from typing import Any

from flint import arb, arb_series

from tippedisk_verify.certified import closed_forms
from tippedisk_verify.certified.angles import NONINVERTED
from tippedisk_verify.certified.balls import (
    ball,
    ball_constants,
    coefficient,
    hull,
    measured,
    negative,
    positive,
    series_length,
    working_precision,
)
from tippedisk_verify.certified.rounding import TABLE, Box, decided, meets, rounding_box, rounding_interval, rounds_to
from tippedisk_verify.errors import Shortfall
from tippedisk_verify.model.measured import Measured, exact_text
from tippedisk_verify.model.parameters import CALIBRATED, PRINTED, SYMBOLS, Parameters

__all__ = [
    "OMEGA_H",
    "PRINTED_NUMBERS",
    "Follows",
    "OfDisk",
    "TableStudy",
    "omega_h_statements",
    "study_table",
    "with_gravity",
]

#: Section sec:shooting: where the branch of limit cycles ends [rad/s].
OMEGA_H = "30.07"
_BITS = 200  # far more than any printed digit needs, and not seen in the time
_MOST_BOXES = 200_000


def _omega_crit(p: Any) -> Any:
    """Eq. approx_omega_crit [rad/s]; Bbar / m = B / m - e^2."""
    reach = p.r + p.e
    return (reach * reach * p.g / (p.r * (p.B / p.m - p.e * p.e))).sqrt()


def _period(p: Any) -> Any:
    """2 pi / (Omega_crit sqrt(e / (r + e))) [s]: Eq. omega_sol at Omega_crit."""
    return 2 * arb.pi() / (_omega_crit(p) * (p.e / (p.r + p.e)).sqrt())


def _stiff(p: Any) -> Any:
    """A33 = -mu g (r + e)^2 / (epsilon Bbar / m) [1/s] (Eq. closed_la3)."""
    reach = p.r + p.e
    return -1 * (p.mu * p.g * reach * reach / (p.epsilon * (p.B / p.m - p.e * p.e)))


def _chi(p: Any) -> Any:
    """chi [kg m^3] (below Eq. Csol)."""
    return closed_forms.chi(SimpleNamespace(r=p.r, e=p.e, A=p.A, Bbar=p.B - p.m * p.e * p.e))


#: What the paper prints of the model's closed forms: name, printed decimal, formula.
PRINTED_NUMBERS: tuple[tuple[str, str, Callable[[Any], Any]], ...] = (
    ("omega_crit", "30.92", _omega_crit),
    ("period", "0.886", _period),
    ("lambda_3", "-129.04", _stiff),
    ("chi", "1.31e-7", _chi),
)
#: The same formulas for statements.
_IN_WORDS = {
    "omega_crit": "omega_crit = (r + e) sqrt(g / (r (B / m - e^2)))",
    "period": "period = 2 pi / sqrt(e (r + e) g / (r (B / m - e^2)))",
    "lambda_3": "lambda_3 = -mu g (r + e)^2 / (epsilon (B / m - e^2))",
    "chi": "chi = A (r - 2 e) - (B - m e^2) (2 r^2 + e (r + e)) / (2 (r + e))",
}


def _where(gravity: Fraction, *names: str) -> str:
    """The hypotheses of a statement about these numbers: definitions, constants, Table 1 and how it is rounded."""
    units = {item.name: item.metadata.get("unit") for item in fields(Parameters)}
    table = ", ".join(f"{name} = {text} {units[name]}" for name, text in TABLE.items())
    parts = [_IN_WORDS[name] for name in names]
    parts += [f"g = {exact_text(gravity)} m/s^2", f"mu = {exact_text(PRINTED.mu)}"]
    parts += [f"epsilon = {exact_text(PRINTED.epsilon)} m/s", f"Table 1 is {table}"]
    return (
        f"where {', '.join(parts)}, and a disk rounds to Table 1 if each of these five values is within half a unit "
        "of the last digit given there"
    )


@dataclass(frozen=True)
class Follows:
    """One printed number against the table."""

    name: str
    printed: str
    gravity: Fraction  #: g [m/s^2]
    from_table: Measured  #: with Table 1 taken as exact
    from_table_follows: bool  #: whether that rounds to the printed decimal
    least: Measured  #: over all disks that round to the table; taken at a corner of the box
    greatest: Measured
    can_follow: bool  #: whether some disk that rounds to the table gives a number that rounds to the printed one
    #: quantities whose rounding suffices, all others as printed, with the interval of values that round to the printed
    #: number: at most 2^-60 of the rounding box too wide at either end
    alone: Mapping[str, tuple[Fraction, Fraction]]

    @property
    def statement(self) -> str:
        where = _where(self.gravity, self.name)
        exactly = "rounds" if self.from_table_follows else "does not round"
        if not self.can_follow:
            return f"no disk that rounds to Table 1 gives {self.name} = {self.printed}, {where}."
        alone = f"the rounding of {' or of '.join(self.alone)} alone" if self.alone else "no single quantity's rounding"
        return (
            f"{self.name} of Table 1 taken as exact {exactly} to {self.printed}; among the disks that round to Table 1 "
            f"some give it, and {alone} suffices, {where}."
        )

    def json(self) -> dict[str, object]:
        return {
            "name": self.name,
            "printed": self.printed,
            "from_table": self.from_table.json(),
            "from_table_follows": self.from_table_follows,
            "least": self.least.json(),
            "greatest": self.greatest.json(),
            "can_follow": self.can_follow,
            "alone": {
                name: {"from": f"{float(low):.7g}", "to": f"{float(high):.7g}"}
                for name, (low, high) in self.alone.items()
            },
            "statement": self.statement,
        }


@dataclass(frozen=True)
class OfDisk:
    """What one disk has to do with the table and the printed numbers."""

    parameters: Parameters
    outside: tuple[str, ...]  #: quantities that do not round to the table, or are not the paper's mu or epsilon
    missed: tuple[str, ...]  #: printed decimals that its numbers do not round to

    @property
    def statement(self) -> str:
        table = f"does not round to Table 1 ({', '.join(self.outside)})" if self.outside else "rounds to Table 1"
        missed = [f"{name} = {text}" for name, text, _ in PRINTED_NUMBERS if text in self.missed]
        numbers = f"does not give {', '.join(missed)}" if missed else "gives all printed numbers"
        return f"'{self.parameters.name}', with {self.parameters.definition()}, {table}; it {numbers}."


@dataclass(frozen=True)
class TableStudy:
    """The printed numbers one by one and all at once, and what holds for every disk that rounds to the table."""

    gravity: Fraction
    disk: OfDisk  #: the disk that was asked about
    numbers: tuple[Follows, ...]
    witness: Parameters | None  #: a disk that rounds to the table and gives all printed numbers at once
    alone: tuple[str, ...]  #: quantities whose rounding alone, all others as printed, can give all at once
    always_supercritical: bool
    boxes: int  #: that cover the rounding box in the proof of the line before

    @property
    def statements(self) -> tuple[str, ...]:
        sentences = [number.statement for number in self.numbers]
        names = [number.name for number in self.numbers]
        if self.witness is not None:
            together = ", ".join(f"{number.name} = {number.printed}" for number in self.numbers)
            sentences.append(
                f"all {len(names)} at once, {together}, follow from one disk that rounds to Table 1 "
                f"('{self.witness.name}', {self.witness.definition()}"
                + (
                    f"; so can the rounding of {' or of '.join(self.alone)} alone"
                    if self.alone
                    else "; the rounding of no single quantity, the others as printed, gives all"
                )
                + f"), {_where(self.gravity, *names)}."
            )
        sentences.append(self.disk.statement)
        if self.always_supercritical:
            sentences.append(
                "for every disk that rounds to Table 1 the Hopf point of inverted spinning under the linear friction "
                "law is supercritical, and noninverted spinning is unstable at every speed Omega > 0, "
                f"{_where(self.gravity)}."
            )
        return tuple(sentences)

    def json(self) -> dict[str, object]:
        return {
            "g": Measured(self.gravity, Fraction(0)).decimals()[0],
            "numbers": [number.json() for number in self.numbers],
            "disk": {
                "name": self.disk.parameters.name,
                "outside": list(self.disk.outside),
                "missed": list(self.disk.missed),
            },
            "all_at_once": None if self.witness is None else self.witness.decimals(),
            "alone": list(self.alone),
            "always_supercritical": self.always_supercritical,
            "boxes": self.boxes,
            "statements": list(self.statements),
        }


def omega_h_statements(
    proved: Sequence[tuple[Parameters, Measured]],
    witness: Parameters | None = None,
    printed: str = OMEGA_H,
    *,
    excluded: Collection[str] = (),
) -> tuple[str, ...]:
    """Whether each disk's proved Omega_h rounds to the printed decimal.

    ``witness`` is a disk that gives all of `PRINTED_NUMBERS`. For the sets ``excluded`` no speed that rounds to the
    decimal has a connection (`no_connection`); of others only the connection that was found is spoken of, because it is
    the only one in its own interval and not in all the world.
    """
    sentences = []
    with working_precision(_BITS):
        for disk, omega_h in proved:
            ends = hull(omega_h.value - omega_h.uncertainty, omega_h.value + omega_h.uncertainty)
            answer = "rounds" if decided(rounds_to(ends, printed)) else "does not round"
            which = f"'{disk.name}', the tippedisk with {disk.definition()}, under the linear friction law"
            further = ", and no speed that does has a connection on which gamma grows all the way" * (
                disk.name in excluded
            )
            sentences.append(f"the connection of {which} at {omega_h} rad/s {answer} to {printed}{further}.")
            if answer == "rounds" and witness == disk:
                numbers = [f"{name} = {text}" for name, text, _ in PRINTED_NUMBERS]
                sentences.append(
                    f"all {len(numbers) + 1} printed numbers at once, {', '.join(numbers)} and omega_h = {printed}, "
                    f"follow from {which}, where {', '.join(_IN_WORDS.values())} and omega_h is a speed at which "
                    "(pi/2, -pi/2, 0) is connected with (pi/2, 3 pi/2, 0)."
                )
    return tuple(sentences)


def with_gravity(parameters: Parameters, gravity: Fraction) -> Parameters:
    """The disk with this g [m/s^2], named by it if it is not its own."""
    if parameters.g == gravity:
        return parameters
    decimal = Measured(gravity, Fraction(0)).decimals()[0]
    return parameters.changed(g=gravity, name=f"{parameters.name} with g = {decimal}")


def study_table(parameters: Parameters = PRINTED) -> TableStudy:
    """The study for a disk's value of g, and what that disk has to do with it.

    Raises Shortfall if something could not be decided.
    """
    gravity = parameters.g
    fixed = {"g": gravity, "mu": PRINTED.mu, "epsilon": PRINTED.epsilon}
    box = rounding_box()
    with working_precision(_BITS):
        numbers = tuple(_follows(name, printed, formula, box, fixed) for name, printed, formula in PRINTED_NUMBERS)
        judged, candidate = _judged(parameters, box), with_gravity(CALIBRATED, gravity)
        witness = candidate if _gives_all(candidate, box) else None
        alone = tuple(name for name in box if _all_with(name, numbers, gravity, box))
    boxes = _cover_supercritical(box, fixed)
    return TableStudy(gravity, judged, numbers, witness, alone, True, boxes)


def _follows(
    name: str, printed: str, formula: Callable[[Any], Any], box: Box, fixed: Mapping[str, Fraction]
) -> Follows:
    signs = {quantity: _slope_sign(formula, quantity, box, fixed) for quantity in box}
    middle = {quantity: Fraction(TABLE[quantity]) for quantity in box}

    def value(**changed: Fraction) -> Any:
        return formula(SimpleNamespace(**{key: ball(number) for key, number in {**fixed, **middle, **changed}.items()}))

    least, greatest = (
        value(**{quantity: box[quantity][(sign > 0) == upward] for quantity, sign in signs.items()})
        for upward in (False, True)
    )
    alone = {
        quantity: solutions
        for quantity, sign in signs.items()
        if sign and (solutions := _solutions(_of_one(value, quantity), sign, box[quantity], printed))
    }
    exactly = value()
    return Follows(
        name=name,
        printed=printed,
        gravity=fixed["g"],
        from_table=measured(exactly),
        from_table_follows=decided(rounds_to(exactly, printed)),
        least=measured(least),
        greatest=measured(greatest),
        can_follow=meets(least, greatest, printed),
        alone=alone,
    )


def _of_one(value: Callable[..., Any], quantity: str) -> Callable[[Fraction], Any]:
    return lambda x: value(**{quantity: x})


def _solutions(
    value: Callable[[Fraction], Any], sign: int, ends: tuple[Fraction, Fraction], printed: str
) -> tuple[Fraction, Fraction] | None:
    """All x between the ends whose value rounds to the printed decimal, for a monotone function; None if none does.

    An interval that holds them and is at most 2^-60 of the ends' distance too wide at either end. That there are some
    is shown by one of them, in the middle. Raises Shortfall if that cannot be decided.
    """
    low, high = ends
    bottom, top = map(ball, rounding_interval(printed)[::sign])

    def before(x: Fraction) -> bool:  # the value has not come as far as the decimal's interval
        return bool(value(x) < bottom if sign > 0 else value(x) > bottom)

    def beyond(x: Fraction) -> bool:
        return bool(value(x) > top if sign > 0 else value(x) < top)

    if before(high) or beyond(low):
        return None
    step = (high - low) / 2**60
    if before(low):
        outside, inside = low, high
        while inside - outside > step:
            middle = (inside + outside) / 2
            outside, inside = (middle, inside) if before(middle) else (outside, middle)
        low = outside
    if beyond(high):
        outside, inside = high, low
        while outside - inside > step:
            middle = (inside + outside) / 2
            outside, inside = (middle, inside) if beyond(middle) else (outside, middle)
        high = outside
    if not rounds_to(value((low + high) / 2), printed):
        raise Shortfall(f"whether {printed} can be had by one quantity's rounding alone could not be decided")
    return low, high


def _slope_sign(formula: Callable[[Any], Any], quantity: str, box: Box, fixed: Mapping[str, Fraction]) -> int:
    """The sign of one partial derivative over the whole box: 1, -1, or 0 if the quantity does not enter."""
    open_boxes, signs = [dict(box)], set()
    for _ in range(_MOST_BOXES):
        if not open_boxes:
            break
        here = open_boxes.pop()
        slope = _slope(formula, quantity, here, fixed)
        if slope.is_zero():
            signs.add(0)
        elif positive(slope) or negative(slope):
            signs.add(1 if positive(slope) else -1)
        else:
            open_boxes += _halves(here)
    if open_boxes or len(signs) != 1:
        raise Shortfall(f"a number of the paper could not be proved monotone in {quantity} over the rounding box")
    return signs.pop()


def _slope(formula: Callable[[Any], Any], quantity: str, box: Box, fixed: Mapping[str, Fraction]) -> Any:
    values = {name: ball(value) for name, value in fixed.items()} | {name: hull(*ends) for name, ends in box.items()}
    with series_length(2):
        series = {name: arb_series([value, 1 if name == quantity else 0], prec=2) for name, value in values.items()}
        return coefficient(formula(SimpleNamespace(**series)), 1)


def _cover_supercritical(box: Box, fixed: Mapping[str, Fraction]) -> int:
    """The number of balls that cover the box, on each of which the Hopf point is proved supercritical.

    On each, too, noninverted spinning has a negative a0: a positive eigenvalue (a0 is a multiple of Omega^2).
    """
    open_boxes, proved = [dict(box)], 0
    with working_precision(64):
        exact = {name: ball(value) for name, value in fixed.items()}
        for _ in range(_MOST_BOXES):
            if not open_boxes:
                return proved
            here = open_boxes.pop()
            constants = ball_constants(exact | {name: hull(*ends) for name, ends in here.items()})
            numbers = closed_forms.hopf_balls(constants)
            _, _, a0 = closed_forms.characteristic_polynomial(constants, arb(1), NONINVERTED)
            if (
                positive(constants.b)
                and negative(numbers["first_lyapunov_coefficient"])
                and negative(numbers["transversality"])
                and negative(numbers["lambda_3"])
                and negative(a0)
            ):
                proved += 1
            else:
                open_boxes += _halves(here, weights={"r": 8})  # r weighs most in the coefficient
    raise Shortfall("the sign of the first Lyapunov coefficient could not be decided over the rounding box")


def _halves(box: Mapping[str, tuple[Fraction, Fraction]], weights: Mapping[str, int] | None = None) -> list[Any]:
    weight = weights or {}
    side = max(box, key=lambda name: (box[name][1] - box[name][0]) / box[name][0] * weight.get(name, 1))
    low, high = box[side]
    middle = (low + high) / 2
    return [{**box, side: (low, middle)}, {**box, side: (middle, high)}]


def _judged(parameters: Parameters, box: Box) -> OfDisk:
    point = SimpleNamespace(**{name: ball(getattr(parameters, name)) for name in SYMBOLS})
    ends = {**box, "mu": (PRINTED.mu, PRINTED.mu), "epsilon": (PRINTED.epsilon, PRINTED.epsilon)}
    return OfDisk(
        parameters,
        tuple(name for name, (low, high) in ends.items() if not low <= getattr(parameters, name) <= high),
        tuple(text for _, text, formula in PRINTED_NUMBERS if not decided(rounds_to(formula(point), text))),
    )


def _gives_all(parameters: Parameters, box: Box) -> bool:
    judged = _judged(parameters, box)
    return not judged.outside and not judged.missed


def _all_with(quantity: str, numbers: tuple[Follows, ...], gravity: Fraction, box: Box) -> bool:
    """Whether one value of this quantity, the others as printed, gives every number."""
    low, high = box[quantity]
    for number in numbers:
        if quantity in number.alone:
            low, high = max(low, number.alone[quantity][0]), min(high, number.alone[quantity][1])
        elif not number.from_table_follows:
            return False
    # The intervals hold all such values, so there is none where they do not meet; where they do, one must be shown.
    if low > high:
        return False
    if not _gives_all(PRINTED.changed(g=gravity, **{quantity: (low + high) / 2}), box):
        raise Shortfall(f"the intervals of {quantity} meet in too short a piece to tell")
    return True
