"""The kinds of draws: what is drawn, what is asked through the package's doors, and what
tells the truth about it.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from fractions import Fraction
from functools import lru_cache, partial
from typing import Any

from reference_data.make.local import hopf_by_balance
from tests.friction_laws import ARCTAN, OWN_LAWS
from tests.honesty.harness import STRUCTURED, Draw, Kind, Question, decay, decimal
from tippedisk_verify import (
    DOUBLE,
    QUADRUPLE,
    AccuracyError,
    Disk,
    Event,
    InputError,
    Measured,
    Parameters,
    Request,
    Status,
    analyse_slow_manifold,
    bisect_omega_h,
    collocation_cycle,
    exact,
    omega_crit,
    precision_of_bits,
    shoot_limit_cycle,
)
from tippedisk_verify.cycles.collocation.collocation_cycles import collocation_rotating_cycle
from tippedisk_verify.cycles.families.family import batch_solver
from tippedisk_verify.cycles.families.interpolant import FamilyInterpolant
from tippedisk_verify.cycles.families.librating_family import LibratingFamily
from tippedisk_verify.cycles.limit_cycle import LimitCycle
from tippedisk_verify.cycles.near_omega_h.cycles_by_broyden import fixed_point_by_broyden
from tippedisk_verify.cycles.shooting.error_budget import numbers_in_precision
from tippedisk_verify.cycles.shooting.section import LIBRATING, ROTATING, SECTION_RETURN, VARIATIONS
from tippedisk_verify.flow import default_batch_engine, default_engine
from tippedisk_verify.flow.contract import BETA_EXTREME, SECTION, SLIDING_REVERSAL
from tippedisk_verify.flow.start import starts_at_rest
from tippedisk_verify.numbers.exact import PI, fraction, rational_in_context
from tippedisk_verify.proofs.closed_forms import proved_equilibrium, proved_hopf
from tippedisk_verify.reference_values.entries import Case, ReferenceEntry
from tippedisk_verify.reference_values.truths import cross_check_values, true_values
from tippedisk_verify.theory import slow_manifold
from tippedisk_verify.theory.hopf import criticality

_LAWS = ("linear", "smooth")
_STIFFEST = 2e3  # 1/s; the truth about the cycles of a stiffer disk takes minutes


def _with_more(ask: Callable[..., Any], digits: int, more: int = 10) -> Question:
    """The truth is the same with more digits."""
    return Question(lambda: ask(digits=digits), lambda _: ask(digits=digits + more))


def _exactly(truth: Any) -> Measured:
    return Measured(fraction(truth), Fraction(0))


def _near(value: Fraction, places: int = 12) -> Fraction:
    """The nearest decimal of so many places."""
    return Fraction(round(value * 10**places), 10**places)


# ------------------------------------------------------------------------------ without integrators
def right_hand_side(draw: Draw) -> Question:
    """The equations' terms, the acceleration and its derivatives, against the same in shifted
    angles.
    """
    disk = draw.disk(law=draw.choice(_LAWS))
    # Rational: pi has no place there
    angles = (decimal(float(DOUBLE.number(part)), 12) for part in draw.state())
    place = dict(zip(("Omega", "beta", "gamma", "v"), (draw.speed(disk), *angles), strict=True))
    case = Case(
        ReferenceEntry(f"drawn/{draw.choice(('both', disk.friction))}/rhs/1", {}), disk, place
    )
    return Question(lambda: true_values(case, 0), lambda known: cross_check_values(case, 0))


def hopf(draw: Draw) -> Question:
    """Against implicit differentiation and the consistent one-harmonic law."""
    disk, digits = draw.disk(), draw.choice((6, 12, 15, 30))
    case = Case(ReferenceEntry("drawn/linear/hopf/point", {}), disk, {})
    return Question(lambda: disk.hopf(digits=digits), lambda _: hopf_by_balance(case, {}))


def slow_manifold_series(draw: Draw) -> Question:
    """Against the recursion at 120 digits; the exponents of the residuals are whole numbers."""
    disk, order = draw.disk(), draw.choice((0, 1, 2, 3))
    omega = draw.told(decimal(float(omega_crit(disk)) * draw.uniform(0.5, 1.5)))

    def ask() -> Any:
        found = analyse_slow_manifold(disk, omega, order)
        return vars(found) | {"right order": True, "place": (found.beta, found.gamma)}

    def truth(found: Any) -> Any:
        ctx = precision_of_bits(400).context
        constants, speed = disk.constants_in_context(ctx), rational_in_context(ctx, omega)
        where = (found["place"], *slow_manifold.RESIDUAL_POINTS)
        place, *points = [[rational_in_context(ctx, part) for part in point] for point in where]
        rows = [
            slow_manifold.invariance_residuals(ctx, constants, speed, *point, order)
            for point in points
        ]
        terms = [slow_manifold.series_orders(ctx, constants, speed, *point, 10) for point in points]
        reduced = found["reduced_omega_crit"] is not None
        sizes = [max(abs(row[n]) for row in terms) * constants.epsilon**n for n in range(1, 11)]
        return {
            "h": [
                _exactly(h)
                for h in slow_manifold.series_orders(ctx, constants, speed, *place, order)
            ],
            "residual": [_exactly(max(abs(row[n]) for row in rows)) for n in range(order + 1)],
            "residual_slope": [_exactly(n + 1) for n in range(order + 1)],
            "smallest_term": _exactly(min(sizes)),
            "reduced_omega_crit": reduced and slow_manifold.reduced_omega_crit(disk, order, 40),
            "right order": found["best_order"] == 1 + sizes.index(min(sizes)),
        }

    return Question(ask, truth)


def proved_closed_forms(draw: Draw) -> Question:
    """Enclosures hold the ordinary numbers of more digits."""
    disk, digits = draw.disk(), draw.choice((6, 12, 30))
    omega, name = draw.speed(disk), draw.choice(("inverted", "noninverted"))

    def truth(_: Any) -> Any:
        return disk.hopf(digits=2 * digits + 20), disk.equilibrium(
            name, omega, digits=2 * digits + 20
        )

    return Question(
        lambda: (proved_hopf(disk, digits), proved_equilibrium(disk, omega, name, digits)), truth
    )


# ------------------------------------------------------------------------------------------- motion
_PASSED = tuple(
    replace(event, name=f"each {event.name}", terminal=False)
    for event in (SECTION, BETA_EXTREME, SLIDING_REVERSAL)
)
_RETURNS = (
    replace(SECTION, name="next section"),
    replace(BETA_EXTREME, name="next turn", terminal=False),
)
_DECAYS = 1000  # of sliding, the longest run: a stiffer disk is followed for a shorter time


def _flown(request: Request) -> Question:
    """Every number of a run in double beside the same run in quadruple precision, or in one
    wider still.
    """

    def ask() -> Any:
        if request.events and starts_at_rest(request):
            raise AccuracyError("at rest to rounding: no event is looked for")
        found = default_engine()(request)
        if (
            not found.status.usable
            or found.error is None
            or not max(found.error.state) < float("inf")
        ):
            raise AccuracyError(f"{found.status.name}, or the two runs did not end alike")
        return _numbers_of(found, found.error) | {
            "alike": True,
            "names": [record.name for record in found.events],
        }

    def truth(answer: Any, wide: Any = QUADRUPLE) -> Any:
        run = default_engine()(
            replace(request, precision=wide, tolerance=None, error_estimate=False)
        )
        return _numbers_of(run, None) | {
            "alike": [record.name for record in run.events] == answer["names"]
        }

    return Question(ask, truth, partial(truth, wide=precision_of_bits(QUADRUPLE.bits + 90)))


def _numbers_of(run: Any, error: Any) -> dict[str, Any]:
    """With the half-widths of an estimate, but for an exact zero, which an event is met at;
    without one exactly.
    """

    def paired(values: Any, widths: Any) -> Any:
        if hasattr(values, "tolist"):
            values = values.tolist()
        if isinstance(values, list):
            return [
                paired(value, widths if widths is None else widths[n])
                for n, value in enumerate(values)
            ]
        known = values is None or (values == 0 and widths == 0)
        return None if known else Measured.of(values, 0 if widths is None else float(widths))

    return {
        name: paired(getattr(run, name), error and getattr(error, name))
        for name in ("state", "samples", "derivatives")
    } | {
        "status": run.status,
        "time": paired(run.time, error and error.time) if error is None or error.time else None,
        "events": paired([record.time for record in run.events], error and error.events),
        "event_states": paired(
            [record.state for record in run.events], error and error.event_states
        ),
    }


def motion(
    draw: Draw,
    laws: Any = _LAWS,
    events: Any = ((), ()),
    loose: bool = False,
    half: bool = False,
    **options: Any,
) -> Question:
    """A run of up to a second, or up to ten: its end, samples, events and derivatives.

    ``events`` are those in the angles themselves and those in shifted ones; ``half`` periods begin
    on the section.
    """
    disk = draw.disk(law=draw.choice(laws))
    omega, place, shift = draw.speed(disk), draw.state(), draw.choice((False, True)) or half
    if half:
        place = exact("pi/2"), place[1], draw.told(exact(decimal(-draw.log_uniform(1e-3, 20))))
    if shift:
        place = place[0] - PI * Fraction(1, 2), place[1] - PI * Fraction(1, 2), place[2]
    longest = min(draw.choice((1.0, 1.0, 10.0)), _DECAYS / decay(disk))
    duration = decimal(longest * draw.choice((draw.uniform(0.1, 1), draw.log_uniform(1e-4, 1))))
    if draw.random() < 0.1:
        duration = -duration / 10  # backward the fast direction explodes
    first = draw.choice((0, 1))
    times = [duration * Fraction(n, 5) for n in range(first, 6)] if draw.random() < 0.4 else None
    tolerance = draw.choice((1e-6, 1e-9, 1e-12, 1e-14)) if loose else None  # each is compiled
    digits = 12 if loose or options else draw.choice((12, 12, 12, 15, 18, 22, 25))
    draw.told(duration)
    return _flown(
        Request(
            disk,
            omega,
            place,
            duration,
            shifted=shift,
            times=times,
            tolerance=tolerance,
            error_estimate=True,
            digits=digits,
            events=events[shift],
            domain="none" if half else "event",
            **options,
        )
    )


def solution(draw: Draw) -> Question:
    """Through `Disk.integrate`, to more digits than doubles have."""
    disk = draw.disk(law=draw.choice(_LAWS))
    omega, state = draw.speed(disk), draw.state()
    duration = draw.told(decimal(min(1.0, _DECAYS / decay(disk)) * draw.uniform(0.1, 1)))

    def ask(digits: int) -> Any:
        found = disk.integrate(
            omega, state, duration, t_eval=[0, duration / 3, duration], digits=digits
        )
        if not max(found.uncertainty[:, -1]) < float("inf"):
            raise AccuracyError(f"rounding decides the end: {found.message}")
        pairs = zip(found.y.ravel().tolist(), found.uncertainty.ravel().tolist(), strict=True)
        return {"status": found.status, "y": [Measured.of(*pair) for pair in pairs]}

    return _with_more(ask, draw.choice((12, 16, 20, 25, 30)), 20)


# ---------------------------------------------------------------------------------------- libration
@lru_cache(maxsize=64)
def _rough_omega_h(disk: Parameters) -> Fraction:
    """Omega_h as double sees it. Raises NoConnectionError or AccuracyError."""
    return bisect_omega_h(disk, default_engine(), confirm=False).omega_h.value


def _librating(draw: Draw, law: Any = "linear") -> tuple[Disk, Fraction]:
    """A disk, and a speed on the side of its Omega_crit where cycles are, mostly above Omega_h."""
    unlike = ("near-equal", "spread", "tiny-eccentricity", "heavy", "far", "far")
    disk = draw.disk((*STRUCTURED, *STRUCTURED, *unlike), law, _STIFFEST)
    crit, side = omega_crit(disk, 30).value, -1 if criticality(disk) == "subcritical" else 1
    share = decimal(draw.choice((draw.uniform(1e-4, 0.02), draw.log_uniform(1e-8, 0.03))))
    # Born unstable, a family may turn back after 1e-4
    omega = crit * (1 - side * share / (1 if side > 0 else 40))
    within = decimal(
        draw.choice(
            (draw.uniform(0.002, 1), 1 - draw.log_uniform(1e-6, 1), draw.log_uniform(1e-4, 1))
        )
    )
    if side > 0 and draw.random() < 0.9:
        with suppress(InputError, AccuracyError):
            omega = crit + (1 - within) * (_rough_omega_h(disk) - crit)
    return disk, draw.told(_near(omega))


def _true_cycle(found: Any, disk: Parameters, digits: int = 22) -> LimitCycle:
    """The cycle near the one found, by shooting with more digits: with many where the slow
    multiplier was lost.
    """
    slow = getattr(found, "multiplier_slow", None)
    if slow is not None and 2 * slow.uncertainty > abs(slow.value):
        digits = 60
    guess, omega = (
        (found.gamma_bar_0.value, found.v_0.value),
        getattr(found.omega, "value", found.omega),
    )
    return shoot_limit_cycle(disk, omega, default_engine(), digits=digits, guess=guess)


def cycle(draw: Draw, law: Any) -> Question:
    """To a number of digits: in double if it holds them, in quadruple precision, or beside a
    wider run.
    """
    disk, omega = _librating(draw, law)
    digits = draw.choice((6, 9, 12, 20, 34))
    # To thirty digits an answer has few to spare
    truth = partial(_true_cycle, disk=disk, digits=digits + 24)
    return Question(lambda: disk.limit_cycle(omega, digits=digits), truth)


def cycle_in_double(draw: Draw, law: str) -> Question:
    """In double, whatever digits that gives."""
    disk, omega = _librating(draw, law)
    return Question(
        lambda: shoot_limit_cycle(disk, omega, default_engine(), precision=DOUBLE),
        partial(_true_cycle, disk=disk),
    )


def balanced(draw: Draw) -> Question:
    """Harmonic balance against shooting, with few harmonics too."""
    disk, omega = _librating(draw)
    options = draw.choice(
        ({"digits": 6}, {"digits": 9}, {"digits": 12}, {"harmonics": 5}, {"harmonics": 12})
    )
    return Question(
        lambda: collocation_cycle(disk, omega, **options), partial(_true_cycle, disk=disk)
    )


def branch(draw: Draw) -> Question:
    """Cycles of the family that are solved together, at speeds between its ends."""
    disk = draw.disk((*STRUCTURED, "far"), stiffest=_STIFFEST, born="supercritical")
    shares = [
        draw.choice((draw.uniform(0.002, 0.998), draw.log_uniform(0.0011, 0.5))) for _ in range(3)
    ]
    omega_h = float(_rough_omega_h(disk))

    def ask() -> Any:
        lanes = default_batch_engine()
        known = LibratingFamily(disk, default_engine(), batch_solver(LIBRATING, disk, lanes))
        omegas = [omega_h + share * (known.omega_crit - omega_h) for share in shares]
        return [
            cycle
            for some in FamilyInterpolant(known, lanes).cycles_at_speeds(omegas, 0)
            for cycle in some or ()
        ]

    return Question(ask, lambda cycles: [_true_cycle(one, disk) for one in cycles])


def folds(draw: Draw) -> Question:
    disk = draw.disk(
        ("nearby", "nearby", "far"), draw.choice(("linear", "linear", "smooth")), 300, "subcritical"
    )
    return _with_more(disk.folds, draw.choice((9, 12)))


def next_to_omega_h(draw: Draw, law: str) -> Question:
    """A cycle a named distance above Omega_h, to more digits than passages have."""
    disk = draw.disk(STRUCTURED, law, 500)
    above = draw.told(
        decimal(draw.choice((draw.log_uniform(1e-5, 1e-2), draw.log_uniform(1e-12, 1e-5))), 4)
    )
    # Quadruple precision answers up to 28 digits, and the truth must be sharper.
    return _with_more(partial(disk.limit_cycle, above_het=above), 16, 24)


def by_passages(draw: Draw) -> Question:
    """A librating cycle above Omega_h or a rotating one below it, mostly closer than 1e-5 rad/s.

    The reference is a single iteration with flights over the whole cycle, at the claim's own speed.
    """
    disk = draw.disk(STRUCTURED, draw.choice(_LAWS), 500)
    distance = draw.told(decimal(draw.log_uniform(1e-60, 1e-3), 4))
    librates = draw.random() < 0.5

    def ask() -> Any:
        if librates:
            return disk.limit_cycle(above_het=distance)
        return disk.rotating_cycle(below_het=distance)

    def truth(found: Any) -> Any:
        section, above = (LIBRATING, distance) if librates else (ROTATING, -distance)
        omega = found.omega.value
        near = fixed_point_by_broyden(
            section, disk, omega, omega - above, default_engine(), digits=32
        )
        numbers = numbers_in_precision(near, near.return_map.precision)
        return {name: _exactly(number) for name, number in numbers.items()}

    return Question(ask, truth)


def connection(draw: Draw, method: str, law: str = "linear") -> Question:
    """Omega_h by one of its methods, with the saddle's eigenvalues there, against the
    manifolds to more digits.
    """
    ask = draw.disk(STRUCTURED, law, 500).heteroclinic
    digits = 12 if method in ("manifolds", "limit-cycles") else 6
    return Question(lambda: ask(method=method, digits=digits), lambda _: ask(digits=24))


# ----------------------------------------------------------------------------------------- rotation
def _rotating(draw: Draw, law: str) -> tuple[Disk, Fraction, bool]:
    """A disk, a speed where mostly it has rotating cycles, and whether the stable one is meant."""
    while True:
        disk, stable = draw.disk((*STRUCTURED, "far"), law, 500), draw.random() < 0.5
        share = draw.log_uniform(2e-5, 1e-3) if stable else draw.uniform(5e-4, -0.03)
        with suppress(InputError, AccuracyError):
            return disk, draw.told(_near(_rough_omega_h(disk) * (1 - decimal(share)), 9)), stable


def rotating(draw: Draw, law: str) -> Question:
    """Against collocation, which shares no integrator, or more digits."""
    disk, omega, stable = _rotating(draw, law)
    ask = partial(disk.rotating_cycle, omega, stable=stable)
    if law == "linear" and not stable:  # next to Omega_h collocation takes its time
        return Question(
            ask, lambda _: collocation_rotating_cycle(disk, omega, stable=stable, digits=17)
        )
    return _with_more(ask, draw.choice((9, 12)))


def rotating_fold(draw: Draw) -> Question:
    disk = draw.disk(STRUCTURED, draw.choice(("linear", "linear", "smooth")), 500)
    return _with_more(disk.rotation_fold, draw.choice((9, 12)), 8)


def below_omega_h(draw: Draw) -> Question:
    disk = draw.disk(STRUCTURED, draw.choice(_LAWS), 500)
    below = draw.told(decimal(draw.log_uniform(1e-20, 1e-2), 4))
    # Quadruple precision answers up to 28 digits, and the truth must be sharper.
    return _with_more(partial(disk.rotating_cycle, below_het=below), 16, 24)


def basin_boundary(draw: Draw) -> Question:
    """Against bisection in quadruple precision on what becomes of a start.

    Brent's method asks for the same run twice, so that no bits may be moved.
    """
    disk = draw.disk(("named",), draw.choice(("linear", "linear", "smooth")))
    omega = draw.told(_near(omega_crit(disk, 20).value + Fraction(draw.choice(("-0.2", "0.5")))))
    gamma, v = draw.told(draw.uniform(-1.5, 4.7)), draw.told(draw.uniform(-6, 6))
    upright = Event("upright", SECTION.function)

    def lies_flat(beta: Fraction) -> bool:
        engine, wide = default_engine(), {"precision": QUADRUPLE}
        # Past the transient
        run = engine(Request(disk, omega, (beta, Fraction(gamma), Fraction(v)), "0.5", **wide))
        if run.status is not Status.FLAT:
            run = engine(Request(disk, omega, run.state.tolist(), 200, events=(upright,), **wide))
        return run.status is Status.FLAT

    def truth(sheet: Measured) -> Measured:
        low, high = (sheet.value + side * sheet.uncertainty * 2 for side in (-1, 1))
        if (lies_flat(low), lies_flat(high)) != (False, True):
            return _exactly(10)  # nowhere near
        while (high - low) * 60 > sheet.uncertainty:
            middle = (low + high) / 2
            low, high = (low, middle) if lies_flat(middle) else (middle, high)
        return Measured((low + high) / 2, (high - low) / 2)

    return Question(lambda: disk.basin_boundary(omega).sheets(gamma, v)[1], truth)


# ---------------------------------------------------------------------------------------- the table
#: The kinds; draws in the default tests, those of the slow ones besides, and the minutes that these
#: take.
KINDS = (
    Kind("right-hand side", right_hand_side, 8, 150, 0.1, flown=False),
    Kind("Hopf point", hopf, 5, 100, 0.1, flown=False),
    Kind("slow manifold", slow_manifold_series, 1, 3, 0.15, flown=False),
    Kind("proved closed forms", proved_closed_forms, 8, 30, 0.1, flown=False),
    Kind("flow", motion, 8, 250, 0.4),
    Kind("flow, own friction laws", partial(motion, laws=OWN_LAWS), 1, 200, 0.5),
    Kind("events", partial(motion, events=(_PASSED, _RETURNS)), 2, 200, 0.2),
    Kind("derivatives", partial(motion, variations=VARIATIONS), 0, 30, 0.8),
    Kind(
        "half periods",
        partial(motion, half=True, events=((), (SECTION_RETURN,)), variations=VARIATIONS),
        4,
        100,
        0.25,
    ),
    Kind("flow at a tolerance", partial(motion, loose=True), 0, 50, 0.1),
    # Beyond doubles a half-width bounds what fewer nodes leave out, which is far more than more of
    # them do.
    Kind("solution", solution, 1, 16, 0.1, widest=1000),
    Kind("limit cycle", partial(cycle, law="linear"), 0, 9, 1.3),
    Kind("limit cycle, smooth", partial(cycle, law="smooth"), 0, 4, 0.3),
    Kind("limit cycle, own friction law", partial(cycle, law=ARCTAN), 0, 3, 0.3),
    Kind("limit cycle in double", partial(cycle_in_double, law="linear"), 2, 20, 0.35),
    Kind("limit cycle in double, smooth", partial(cycle_in_double, law="smooth"), 0, 7, 0.2),
    Kind("harmonic balance", balanced, 1, 11, 0.15, flown=False),
    Kind("branch", branch, 1, 3, 0.3),
    Kind("folds", folds, 0, 2, 0.2),
    Kind("next to Omega_h", partial(next_to_omega_h, law="linear"), 0, 2, 0.3),
    Kind("next to Omega_h, smooth", partial(next_to_omega_h, law="smooth"), 0, 2, 0.5),
    # Eight times the largest of four errors that are four times as large.
    Kind("by passages", by_passages, 0, 12, 5, widest=300),
    Kind("Omega_h by manifolds", partial(connection, method="manifolds"), 0, 4, 0.15),
    Kind("Omega_h by limit cycles", partial(connection, method="limit-cycles"), 1, 2, 0.1),
    Kind("Omega_h by bisection", partial(connection, method="bisection"), 1, 5, 0.1),
    Kind("Omega_h, smooth", partial(connection, method="manifolds", law="smooth"), 0, 2, 0.2),
    Kind(
        "Omega_h, smooth, by bisection",
        partial(connection, method="bisection", law="smooth"),
        0,
        2,
        0.1,
    ),
    Kind("rotating cycle", partial(rotating, law="linear"), 1, 5, 0.3),
    Kind("rotating cycle, smooth", partial(rotating, law="smooth"), 0, 2, 0.25),
    Kind("fold of rotating cycles", rotating_fold, 0, 2, 0.3),
    Kind("rotating, next to Omega_h", below_omega_h, 0, 2, 0.4),
    Kind("basin boundary", basin_boundary, 0, 3, 0.2, flown=False),
)


def kind_named(name: str) -> Kind:
    return next(kind for kind in KINDS if kind.name == name)
