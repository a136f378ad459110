"""The checker's flights over curves of starts: sets of states, steps, the return, Krawczyk's test and the signs.

Where a rule is asked for by itself, the motion is made up: its numbers are small and the answer is worked out by hand.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from itertools import product
from types import SimpleNamespace
from typing import Any

import pytest
from flint import arb, arb_mat, ctx
from tippedisk_verify.proofs.checker.curves import Arc, Curve, Flight, Step, Tube
from tippedisk_verify.proofs.checker.jets import Jet, sines, small_sines

from tests.proofs.test_family_certificate import DISK, value
from tippedisk_verify.proofs import checker
from tippedisk_verify.proofs.checker import curves, steps
from tippedisk_verify.proofs.kernel.balls import working_precision

UNIT = [[int(row == column) for column in range(3)] for row in range(3)]
HAIR = arb(0, arb(2) ** -40)  # above the roundings of a handful of operations in 64 bits


@pytest.fixture(autouse=True)
def _context() -> Iterator[None]:
    cap = ctx.cap
    with working_precision(64):
        ctx.cap = 24
        yield
    ctx.cap = cap


def constant(x: Any) -> Jet:
    return Jet([arb(x), arb(0)])


# ------------------------------------------------------------------------------------------------------------- sines
def test_the_rests_of_the_sines_are_there() -> None:
    """At arguments so far from the centre that the Taylor polynomials alone miss the values."""
    for x in (2.5, -3.0):
        for s in (-1, 1):
            truths = (arb(x) * s).sin(), (arb(x) * s).cos()
            for found, truth in zip(sines(Jet([arb(0), arb(x), *[arb(0)] * 9])), truths, strict=True):
                assert sum((s**k * part for k, part in enumerate(found.c)), arb(0)).overlaps(truth)
    y = arb(60)
    found = small_sines(Jet([y]), Jet([arb(1)]))
    for part, truth in zip(found, (y.sin(), y.cos(), (y * y.cos() - y.sin()) / 2), strict=True):
        assert part.c[0].overlaps(truth)


# ------------------------------------------------------------------------------------------------------ sets of states
def test_values_are_held_by_every_degree() -> None:
    jet = Jet([arb(1), arb(-2), arb(3), arb(5), arb(-7)])
    for degree, s in product(range(7), (-1, -0.75, 0, 0.5, 1)):
        chebyshev = [1, s, 2 * s**2 - 1, 4 * s**3 - 3 * s, 8 * s**4 - 8 * s**2 + 1]
        truth = sum(x * y for x, y in zip((1, -2, 3, 5, -7), chebyshev, strict=True))
        found = jet.cut(degree)
        assert len(found.c) == min(degree, 4) + 1
        known = chebyshev[: degree + 1]
        assert sum((x * y for x, y in zip(found.c, known, strict=False)), arb(0)).contains(truth)
        assert [x.mid() for x in found.c[: min(degree, 4) + 1]] == [1, -2, 3, 5, -7][: degree + 1]


def made_up_tube(rest: Sequence[Any]) -> Tube:
    tube = object.__new__(Tube)
    tube.curve, tube.away = SimpleNamespace(), arb_mat([[arb(0)], [arb(0, 0.5)], [arb(0, 0.25)]])
    tube.middle, tube.lead = Jet([arb_mat([[1], [2], [3]])]), Jet([arb_mat([[1, 0, 2], [0, 3, 1], [1, 1, 0]])])
    tube.axes, tube.rest = arb_mat([[2, 1, 0], [0, 1, 0], [0, 0, 4]]), arb_mat([[x] for x in rest])
    tube.own, tube.spread = arb_mat([[arb(0, 0.125)]] * 3), arb_mat([[arb(1, 0.125)] * 3] * 3)
    return tube


def test_a_box_holds_the_states_and_the_middle() -> None:
    """The rest need not hold zero."""
    tube = made_up_tube([arb(2, 1), arb(-2, 1), arb(2, 1)])
    box = [part.c[0] for part in tube.box()]
    assert all(x.contains(y) for x, y in zip(box, (1, 2, 3), strict=True))
    for signs in product((-1, 1), repeat=5):
        away = arb_mat([[0], [arb(0.5) * signs[3]], [arb(0.25) * signs[4]]])
        rest = arb_mat([[arb(x) + sign] for x, sign in zip((2, -2, 2), signs, strict=False)])
        state = tube.middle.c[0] + tube.lead.c[0] * away + tube.axes * rest
        assert all(x.contains(y) for x, y in zip(box, state.entries(), strict=True))


def test_a_carried_set_holds_the_image() -> None:
    """Every corner of the balls of the map, of the deviations and of the rest; so for the derivatives."""
    tube = made_up_tube([arb(0, 0.5), arb(1, 0.5), arb(0, 2)])
    centre, lead = arb_mat([[arb(x, 0.25)] for x in (5, 6, 7)]), arb_mat([[arb(x, 0.125) for x in (1, 2, 4)]] * 3)
    turned, axes = arb_mat([[arb(x, 0.25) for x in (2, 1, 1)]] * 3), arb_mat([[1, 2, 0], [0, 1, 0], [0, 0, 2]])
    image = tube.carried(Jet([centre]), Jet([lead]), turned, axes)

    def end(matrix: Any, sign: int) -> Any:
        ends = [x.mid() + sign * x.rad() for x in matrix.entries()]
        return arb_mat(matrix.nrows(), matrix.ncols(), ends)

    def hold(room: Any, x: Any) -> bool:
        return all(a.contains(b) for a, b in zip(room.entries(), (axes.inv() * x).entries(), strict=True))

    for signs in product((-1, 1), repeat=5):
        a, b, c, d, q = (end(x, sign) for x, sign in zip((centre, lead, turned, tube.away, tube.rest), signs,
                                                         strict=True))  # fmt: skip
        assert hold(image.rest, a + b * d + c * q - image.middle.c[0] - image.lead.c[0] * d)
        assert hold(image.own, a + c * end(tube.own, signs[3]) - image.middle.c[0])
        assert hold(image.spread, b + c * end(tube.spread, signs[3]) - image.lead.c[0])
    with pytest.raises(checker.Unproved, match="no inverse"):
        tube.carried(Jet([centre]), Jet([lead]), turned, arb_mat(3, 3))


# ------------------------------------------------------------------------------------------------------------- steps
def curve_of(radii: Sequence[float] = (0, 0), *, scaled: bool = False, top: str = "0.105", bent: int = 1) -> Curve:
    """Near the family from inverted spinning; half the period is about 0.44 s."""
    first = "-1.625" if scaled else "-0.17"
    p = [Jet([arb(x), arb(slope) * bent]) for x, slope in ((top, "0.002"), (first, "0.001"), ("30.88", "0.001"))]
    away = [arb(0), *(arb(0, x) for x in radii)]
    return Curve(steps.Flow(DISK, arb(1)), scaled, p, away, Jet([arb("0.44"), arb("0.001") * bent]))


def test_a_step_is_refused_that_is_too_long_or_backwards() -> None:
    tube = Tube(curve_of((1e-4, 1e-3)))
    Step(tube, arb("0.01"))
    for share, line in (
        ("0.1", "stay in its enclosure"),
        ("0.3", "stay in its enclosure"),
        ("0", "length is not"),
        ("-0.01", "length is not"),
    ):
        with pytest.raises(checker.Unproved, match=line):
            Step(tube, arb(share))
    with pytest.raises(checker.Unproved, match="amplitude"):
        curve_of(scaled=True, top="0.999")


@pytest.mark.parametrize("length", [1, 2, 4, 8, 11, 12, 13])
@pytest.mark.parametrize("moment", range(5))
def test_a_step_whose_series_are_cut_off_is_refused(moment: int, length: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """It is ten times too long, and the remainder that says so would read as zero."""
    tube, calls = Tube(curve_of((1e-4, 1e-3))), iter(range(5))

    def meddled(known: Callable[..., Any]) -> Callable[..., Any]:
        def evaluated(*arguments: Any) -> Any:
            before = ctx.cap
            ctx.cap = length if next(calls) == moment else before
            try:
                return known(*arguments)
            finally:
                ctx.cap = before

        return evaluated

    for name in ("series", "derivatives"):
        monkeypatch.setattr(curves.Motion, name, meddled(getattr(curves.Motion, name)))
    with pytest.raises(checker.Unproved, match=r"cut off|stay in its enclosure"):
        Step(tube, arb("0.1"))


def orbit(start: Sequence[Any], w: Any, time: Any, count: int = 8) -> tuple[list[Any], Any]:
    """The state and its derivatives by the start and the speed, by the equations of `steps`.

    Taylor series of order 30 over some milliseconds at 64 bits more: orbits live for some hundredths of a second, so
    that what is cut off is far below HAIR.
    """
    columns = [*start, *(arb(int(row == column)) for row in range(3) for column in range(4))]
    flow, cap = steps.Flow(DISK, w), ctx.cap
    try:
        for _ in range(count):
            series = flow.taylor(columns, 30)[:15]
            columns = [sum(part * (time / count) ** k for k, part in enumerate(column)) for column in series]
    finally:
        ctx.cap = cap
    return columns[:3], arb_mat(3, 4, columns[3:])


def truth(scaled: bool, p: Sequence[Any], time: Any) -> tuple[list[Any], list[list[Any]]]:
    """The state after a time and its derivatives by p, as the checker has them, from orbits that are not scaled.

    With a y(q) the orbit x from (0, a, a v), dy/dq = (dx/da - y) / (2 a^2).
    """
    if not scaled:
        x, by = orbit([arb(0), p[0], p[1]], p[2], time)
        return x, [[by[row, k] for k in (1, 2, 3)] for row in range(3)]
    a = p[0].sqrt()
    x, by = orbit([arb(0), a, a * p[1]], p[2], time)
    y = [part / a for part in x]
    return y, [[(by[row, 1] + by[row, 2] * p[1] - y[row]) / (2 * p[0]), by[row, 2], by[row, 3] / a] for row in range(3)]


@pytest.mark.parametrize("scaled", [False, True])
def test_steps_hold_orbits_and_their_derivatives(scaled: bool) -> None:
    """Four steps over skew axes, at corners of the deviations, against orbits by other equations."""
    radii, third = (0.01, 0.02), 1 / 3
    curve = curve_of(radii, scaled=scaled)
    tube, time = Tube(curve), 0 * curve.total
    for _ in range(3):
        step = Step(tube, arb("0.015"))
        time, tube = time + step.length, step.after(arb_mat([[1, 0, 0], ["0.5", 1, 0], [-4, "0.3", 1]]))
    step = Step(tube, arb("0.015"))
    (states, by), (own, _) = step.image(step.length), step.image(step.length, own=True)
    when = value(time + step.length, third)
    for signs in ((0, 0), *product((-1, 1), repeat=2)):
        p = [value(part, third).mid() for part in curve.p]
        for k in (1, 2):
            p[k] = p[k] + signs[k - 1] * arb(radii[k - 1])
        exact, slopes = truth(scaled, p, when.mid())
        for row in range(3):
            assert (value(states[row], third) + HAIR).overlaps(exact[row])
            for k in range(3):
                assert (value(by[row][k], third) + HAIR).overlaps(slopes[row][k])
            if signs == (0, 0):
                assert (value(own[row], third) + HAIR).overlaps(exact[row])
                # The curve's own states are narrow: without the deviations, which move the states by 1e-2 and more.
                assert value(own[row], third).rad() < 1e-4


def test_a_step_holds_its_polynomials_rest() -> None:
    """One orbit over a step so long that its polynomial alone is off by far more than the roundings."""
    with working_precision(160):
        curve = curve_of(bent=0)
        step = Step(Tube(curve), arb("0.03"))
        exact, slopes = truth(False, [part.c[0] for part in curve.p], step.length.c[0])
        states, by = step.image(step.length)
        for row in range(3):
            assert states[row].range().overlaps(exact[row])
            assert all(by[row][k].range().overlaps(slopes[row][k]) for k in range(3))


def test_where_v_may_vanish_is_cut_finely() -> None:
    """v = t - 0.7: of 2^9 parts of the step two meet at most where it vanishes, and one more touches it."""
    step = object.__new__(Step)
    step.length = Jet([arb(1)])
    step.image = lambda time: ([time - 1, time, time - arb(0.7)], ["row"])
    parts = list(step.turning())
    assert 1 <= len(parts) <= 3
    assert all(row == "row" for _, row in parts)
    assert any((beta + arb(0.3)).contains(0) for beta, _ in parts)


# ----------------------------------------------------------------------------------------------------------- flights
#: enclosures of beta_bar and v over a step
FALL, TURN, RISE = (arb(-0.05, 0.06), arb(-1, 0.5)), (arb(-0.1, 0.05), arb(0, 1)), (arb(0, 0.1), arb(1, 0.5))


def flown(monkeypatch: pytest.MonkeyPatch, boxes: Sequence[tuple[Any, Any]], v: float = -0.17) -> Flight:
    """A flight whose steps have these enclosures; nothing else about them is looked at."""
    rest = iter(boxes)

    class Enclosed:
        def __init__(self, tube: Any, share: Any) -> None:
            (beta, speed), self.tube = next(rest), tube
            self.enclosure, self.length = [beta, arb(0), speed], constant(0.01)
            self.slopes = [Jet([[arb(0)], [arb(0)]])]

        def turning(self) -> list[str]:
            return ["turn"]

        def after(self, axes: Any) -> Any:
            return self.tube

    monkeypatch.setattr(curves, "Step", Enclosed)
    monkeypatch.setattr(Flight, "_land", lambda *_: None)
    curve = curve_of()
    curve.start[1] = constant(v)
    entries: list[dict[str, Any]] = [{"share": arb(1), "axes": UNIT} for _ in boxes]
    del entries[-1]["axes"]
    return Flight(curve, entries, "arc")


def test_a_flight_falls_turns_and_rises(monkeypatch: pytest.MonkeyPatch) -> None:
    """v < 0 or beta_bar < 0 in each step but the last, v > 0 in that one, and beta upright in all of them."""
    assert flown(monkeypatch, [FALL, TURN, RISE]).turning == ["turn"]
    sinks, rises = (arb(-0.1, 0.05), arb(-0.5, 1)), (arb(-0.1, 0.05), arb(5, 5.5))
    assert flown(monkeypatch, [FALL, sinks, rises, RISE]).turning == ["turn"] * 2
    for boxes, line in (
        ([(FALL[0], arb(0, 1)), RISE], "move as it must"),
        ([FALL, TURN, (arb(0, 0.1), arb(0.5, 1))], "move as it must"),
        ([FALL, (arb(0, 0.1), arb(0, 1)), RISE], "move as it must"),
        ([FALL, (arb(-1.5, 0.08), arb(0, 1)), RISE], "upright"),
        ([FALL, TURN, (arb(1.5, 0.1), arb(2, 1))], "upright"),
    ):
        with pytest.raises(checker.Unproved, match=line):
            flown(monkeypatch, boxes)
    for v in (0, 0.17):
        with pytest.raises(checker.Unproved, match="negative at the start"):
            flown(monkeypatch, [FALL, TURN, RISE], v)


BY = ((0.1, 0.2, 0.3), (1, 2, 3), (4, 5, 6))  # of beta_bar, gamma_bar and v, by p, at a fixed time


def landed(step: Any, guess: float) -> Flight:
    """The return in this step, two seconds after the start; v' is 7 there and div f is 1."""
    curve = SimpleNamespace(wide=SimpleNamespace(q=None, w=constant(30), rate=lambda *_: constant(7)))
    step.tube, step.slopes = SimpleNamespace(curve=curve), [Jet([[arb(0), arb(1)], [arb(0), arb(0)]])]
    flight = object.__new__(Flight)
    flight.divergence = constant(0)
    flight._land(step, constant(2), constant(guess))
    return flight


def straight(length: float = 1.0, wide: float = 0.0) -> Any:
    """beta_bar = t - 0.5 up to ``wide``, gamma_bar = -0.2, v = 1."""
    by = [[constant(x) for x in row] for row in BY]

    def image(time: Any, own: bool = False) -> Any:
        return [time - arb(0.5) + (0 if own else arb(0, wide)), constant(-0.2), constant(1)], by

    return SimpleNamespace(length=constant(length), image=image, enclosure=[arb(0), arb(0), arb(1, 0.1)])


def test_the_return() -> None:
    """At t = 0.5 with -p_t = by_beta / v: gamma_bar, v and their derivatives turn their signs, v' = 7 moves v's."""
    flight = landed(straight(wide=0.01), 0.5)
    assert flight.time.range().contains(arb(2.5))
    # 0.01 / v and what its derivative adds to it
    assert flight.time.range().rad() < 0.05
    assert abs(flight.divergence.range() - arb(0.5)) < 0.05
    near = HAIR.rad()
    assert abs(flight.image[0].range() - arb(0.2)) < near
    assert abs(flight.image[1].range() + 1) < near
    for k, (by_beta, by_gamma, by_v) in enumerate(zip(*BY, strict=True)):
        assert abs(flight.time_by[k].range() + by_beta) < near
        assert abs(flight.by[0][k].range() + by_gamma) < near
        assert abs(flight.by[1][k].range() + by_v - 7 * arb(by_beta)) < near
    for step, guess, line in (
        (straight(length=0.4), 0.5, "passed the section"),
        (straight(length=0.51), 0.52, "within the step"),
        (straight(length=0.9, wide=0.39), 0.5, "within the step"),
        (straight(), -0.01, "within the step"),
    ):
        with pytest.raises(checker.Unproved, match=line):
            landed(step, guess)


def test_the_return_holds_that_of_a_speed_that_changes() -> None:
    """beta_bar = t^2 - 1/4, v = 2 t: the mean value theorem needs v at all moments from the guess to the return."""
    by = [[constant(x) for x in row] for row in BY]
    step = SimpleNamespace(
        length=constant(1), enclosure=[arb(0), arb(0), arb(1.2, 0.8)],
        image=lambda time, own=False: ([time * time - arb(0.25), constant(-0.2), 2 * time], by),
    )  # fmt: skip
    flight = landed(step, 0.45)
    assert flight.time.range().contains(arb(2.5))
    assert flight.own_time.range().contains(arb(2.5))


def test_v_is_positive_at_the_return() -> None:
    """It is asked for at the moment itself, whatever the step's enclosure says."""
    step = straight()
    image = step.image
    step.image = lambda time, own=False: ([image(time)[0][0], constant(-0.2), constant(-1)], image(time)[1])
    with pytest.raises(checker.Unproved, match="positive at the return"):
        landed(step, 0.5)


# -------------------------------------------------------------------------------------------------- Krawczyk's test
def krawczyk(
    monkeypatch: pytest.MonkeyPatch, residual: Sequence[float] = (0, 0), radii: Sequence[float] = (1, 1)
) -> Arc:
    """F(u; p) = residual + (0.1, 0.2) p + [[2, 0.5], [0.3, 3]] u, about u = 0."""
    by = [[constant(x) for x in row] for row in ((0.1, 2, 0.5), (0.2, 0.3, 3))]
    flight = SimpleNamespace(image=[constant(x) for x in residual], by=by)
    monkeypatch.setattr(curves, "Flight", lambda *_: flight)
    curve = SimpleNamespace(
        away=[arb(0), *(arb(0, x) for x in radii)], start=[constant(0)] * 2, unit=[[0, 0, 0], [0, 0, 0]]
    )
    return Arc(curve, [], "arc")


def test_krawczyks_image(monkeypatch: pytest.MonkeyPatch) -> None:
    """det F_u = 5.85; the zero is -F_u^-1 F, and so is the derivative with F_p; a zero outside is not in the box."""
    arc = krawczyk(monkeypatch, (0.5, -0.25))
    near = HAIR.rad()
    for found, exact in zip(arc.within, (-(3 * 0.5 + 0.5 * 0.25), 0.3 * 0.5 + 2 * 0.25), strict=True):
        assert abs(found * 5.85 - exact) < near
    for slope, exact in zip(arc.slopes, (-(3 * 0.1 - 0.5 * 0.2), 0.3 * 0.1 - 2 * 0.2), strict=True):
        assert abs(slope.range() * 5.85 - exact) < near
    assert abs(arc.determinant.range() - 5.85) < near
    for residual, radii in (((3, 0), (1, 1)), ((0, 4), (1, 1)), ((0.5, -0.25), (0.2, 1)), ((0, 0), (0, 1))):
        with pytest.raises(checker.Unproved, match="Krawczyk"):
            krawczyk(monkeypatch, residual, radii)


# ------------------------------------------------------------------------------------------------------------- signs
#: det F_u, derivatives of the image (a, b; d), of the unknowns (v, w), of the time, of one beta_bar, and that one
SIGNS = {"det": -1, "a": 0.2, "b": 0.1, "d": 0.3, "v": -1, "w": -0.5, "time": (2, 0, 0), "rows": [(-1, 0, 0)],
         "beta": -0.2, "divergence": -9, "scaled": False}  # fmt: skip


def signs(**changes: Any) -> None:
    """Of an arc with q = 0.5 and v_0 / a = -1 up to 0.01, trace 0.5, and what is in SIGNS or else in ``changes``."""
    given = SIGNS | changes
    arc = object.__new__(Arc)
    arc.path, arc.slopes = "arc", [constant(given["v"]), constant(given["w"])]
    arc.determinant = constant(given["det"])
    by = [(given["a"], given["b"], 0), (0, given["d"], 0)]
    arc.flight = SimpleNamespace(
        by=[[constant(x) for x in row] for row in by],
        divergence=constant(given["divergence"]),
        time_by=[constant(x) for x in given["time"]],
        turning=[(arb(given["beta"]), [constant(x) for x in row]) for row in given["rows"]],
    )
    p = [constant(x) for x in (0.5, -1, 30)]
    arc.curve = SimpleNamespace(scaled=given["scaled"], p=p, away=[arb(0), arb(0, 0.01), arb(0)])
    arc.signs()


def test_the_signs_hold_in_the_example() -> None:
    signs()
    signs(scaled=True)


@pytest.mark.parametrize(
    ("changes", "line"),
    [
        ({"det": 1}, "stable"),
        ({"d": -1.5}, "stable"),
        ({"a": -1, "d": -0.1}, "stable"),
        ({"divergence": 0.5}, "stable"),
        ({"w": 0.5, "det": 1}, "Omega"),
        ({"time": (-2, 0, 0)}, "period"),
        ({"time": (0, 2, 0)}, "period"),
        ({"time": (0, 0, 2)}, "period"),
        ({"rows": [(1, 0, 0)]}, "beta_max"),
        ({"rows": [(0, -1, 0)]}, "beta_max"),
        ({"rows": [(0, 0, -1)]}, "beta_max"),
        ({"rows": []}, "turn"),
        # 1 + (1 + (1 +- 0.01) b + 2 q a + d) is 0.01 up to 0.025: it may be negative.
        ({"scaled": True, "b": -2.5, "d": 0.29}, "stable"),
        # and 1 + 1 + 0.1 - 2.5 + 0.3 < 0, but not without 2 q a
        ({"scaled": True, "a": -2.5}, "stable"),
        # 2 q beta' + beta is 1 - 0.2, and 0.2 - 0.1, though one of the two terms is negative.
        ({"scaled": True, "rows": [(1, 0, 0)]}, "beta_max"),
        ({"scaled": True, "beta": 0.2, "rows": [(-0.1, 0, 0)]}, "beta_max"),
    ],
)
def test_each_sign_is_asked_for(changes: dict[str, Any], line: str) -> None:
    with pytest.raises(checker.Unproved, match=line):
        signs(**changes)
