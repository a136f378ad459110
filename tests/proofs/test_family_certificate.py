"""The checker's own jets, equations and gluing, and certificates of the family of limit cycles."""

from __future__ import annotations

import copy
import json
import math
import random
import sys
import threading
import time
from collections import Counter
from collections.abc import Callable, Sequence
from fractions import Fraction
from typing import Any

import mpmath
import numpy as np
import pytest
from flint import arb, ctx
from hypothesis import given, settings
from hypothesis import strategies as st
from mpmath import mp
from tippedisk_verify.proofs.checker.family import family_shown
from tippedisk_verify.proofs.checker.jets import Dual, Jet, at, polynomial, sines, small_sines
from tippedisk_verify.proofs.search.family_certificate import chebyshev, family_certificate
from tippedisk_verify.proofs.search.pieces import Piece

from tests.proofs.test_branch import SUBCRITICAL, first, quick, second  # noqa: F401
from tippedisk_verify.model.parameters import CALIBRATED, PRINTED
from tippedisk_verify.proofs import checker
from tippedisk_verify.proofs.checker import curves, steps
from tippedisk_verify.proofs.kernel.balls import working_precision
from tippedisk_verify.proofs.search.branch import BranchProof
from tippedisk_verify.proofs.search.certificate import parameter_texts

DISK = parameter_texts(PRINTED)
SHARES = st.floats(-1, 1)


def value(jet: Jet, s: float) -> Any:
    """The sum of Chebyshev polynomials, by their definition as cosines."""
    angle = arb(s).acos()
    return sum((part * (angle * k).cos() for k, part in enumerate(jet.c)), arb(0))


def jet(numbers: Sequence[float]) -> Jet:
    return Jet([arb(part) for part in numbers])


@settings(max_examples=60, deadline=None)
@given(st.lists(SHARES, min_size=4, max_size=4), st.lists(SHARES, min_size=4, max_size=4), SHARES)
def test_what_jets_give_holds_the_values(a, b, s) -> None:
    x, y = jet(a), jet([5.0, *b[1:]])
    for found, exact in (
        (x + y, value(x, s) + value(y, s)),
        (1 - x, 1 - value(x, s)),
        (x * y, value(x, s) * value(y, s)),
        (x / y, value(x, s) / value(y, s)),
        (sines(x)[0], value(x, s).sin()),
        (sines(x)[1], value(x, s).cos()),
    ):
        assert value(found, s).overlaps(exact)
        assert found.range().overlaps(exact)


def test_a_quotient_is_sharp_and_one_by_what_may_vanish_is_refused() -> None:
    x, y = jet([1.0, 0.1, 0, 0, 0]), jet([2.0, 0.02, 0, 0, 0])
    # Beyond T_4 the quotient has less than (0.02 / 2 / 2)^4 in all: that is what is left over.
    assert (x / y).range().rad() < 0.06 + 2 * 0.005**4
    assert not (x / jet([0.0, 0, 0, 0, 0])).range().is_finite()
    assert not (x / jet([0.5, 1.0, 0, 0, 0])).range().is_finite()


@settings(max_examples=40, deadline=None)
@given(st.floats(-2.5, 2.5), st.floats(0, 0.64))
def test_the_small_sines(x, q) -> None:
    with mp.workprec(200), working_precision(100):
        root, y = mp.sqrt(mp.mpf(q)), mp.mpf(x)
        slope = mp.quad(lambda t: -y * t * mp.sin(root * y * t) / (2 * root), [0, 1]) * y if q else -(y**3) / 6
        truths = (mp.sin(root * y) / root if q else y, mp.cos(root * y), slope)
        for found, truth in zip(small_sines(Jet([arb(x)]), Jet([arb(q)])), truths, strict=True):
            # mpmath's quadrature and its roundings are good to some 55 digits.
            assert abs(found.c[0] - arb(mpmath.nstr(truth, 45))) < arb("1e-20")


def test_the_equations_are_the_checkers_other_ones_and_their_derivatives_too() -> None:
    """`Flow` writes them down unscaled, with derivatives by hand; a state's and a speed's own are by rules here."""
    numbers = np.random.default_rng(5)
    with working_precision(120):
        for _ in range(20):
            b, g, u = (arb(float(part)) for part in numbers.uniform(-1, 1, 3))
            w = arb(float(numbers.uniform(25, 35)))
            flow = steps.Flow(DISK, w)
            rates, by = flow.rates([b, g, u], True)
            ctx.cap = 8
            motion = curves.Motion(flow, Jet([w]), None)
            unit = [[arb(int(row == column)) for row in range(3)] for column in range(4)]
            series = motion.series([Jet([x]) for x in (b, g, u)], 1)
            found = motion.derivatives(series, unit, 1)
            for part, rate in zip(series, rates, strict=False):
                assert part.c[0][1].overlaps(rate)
            for column, index in ((0, 2), (1, 3), (2, 4), (3, 5)):
                assert found[column][2].c[0][1].overlaps(by[index])
            assert found[0][1].c[0][1].overlaps(by[0])
            assert found[3][1].c[0][1].overlaps(by[1])
            assert found[4][0].c[0][1].overlaps(by[4])


def test_scaled_orbits_are_the_orbits() -> None:
    """a y of the scaled equations is the orbit from a times the start; derivatives by q against differences."""
    with working_precision(160):
        ctx.cap = 12
        a, w, start = arb("0.3"), arb("30.2"), [arb("-0.1"), arb("0.9"), arb("-1.4")]
        flow = steps.Flow(DISK, w)

        def series(q: Any) -> list[Jet]:
            return curves.Motion(flow, Jet([w]), Jet([q])).series([Jet([x]) for x in start], 9)

        whole = curves.Motion(flow, Jet([w]), None).series([Jet([a * x]) for x in start], 9)
        scaled = series(a * a)
        unit = [[arb(int(row == column)) for row in range(3)] for column in range(5)]
        by = curves.Motion(flow, Jet([w]), Jet([a * a])).derivatives(scaled, unit, 9)[4]
        h = arb(2) ** -40
        high, low = series(a * a + h), series(a * a - h)
        for k in range(3):
            for n in range(10):
                assert whole[k].c[0][n].overlaps(a * scaled[k].c[0][n])
                slope = (high[k].c[0][n] - low[k].c[0][n]) / (2 * h)
                # The difference's error is h^2 / 6 times a third derivative, below 2^-50 of the largest coefficient.
                assert abs(slope - by[k].c[0][n]) < abs(slope) * arb(2) ** -40 + arb(2) ** -40


def test_derivatives_by_rules() -> None:
    x, y = Dual(Jet([arb(3)]), [Jet([arb(1)]), None]), Dual(Jet([arb(5)]), [None, Jet([arb(1)])])
    quotient = (x * y - x) / (y + 2)  # 12 / 7; by x: 4 / 7; by y: 3 * 3 / 49
    for found, truth in zip(
        (quotient.x, *quotient.by), (Fraction(12, 7), Fraction(4, 7), Fraction(9, 49)), strict=True
    ):
        assert abs(found.c[0] - arb(truth.numerator) / truth.denominator) < arb(2) ** -40


def test_a_series_that_was_cut_off_is_refused() -> None:
    ctx.cap = 3
    try:
        series = curves.Motion(steps.Flow(DISK, arb(30)), Jet([arb(30)]), None).series([jet([0.1])] * 3, 6)
        with pytest.raises(checker.Unproved, match="cut off"):
            polynomial(series[0], 7)
    finally:
        ctx.cap = 10


def test_a_polynomial_at_a_time() -> None:
    terms = Jet([[arb(1), arb(2), arb(3)], [arb(0), arb(1), arb(0)]])
    assert at(terms, arb(2)).c[0] == 17
    moved = at(terms, jet([2.0, 1.0]))  # 1 + (2 + s) t + 3 t^2 at t = 2 + s
    for s in (-1.0, 0.25, 1.0):
        assert value(moved, s).overlaps(arb(1 + (2 + s) ** 2 + 3 * (2 + s) ** 2))


def test_chebyshev_coefficients() -> None:
    given_ = [Fraction(k + 1, 3) for k in range(6)]
    found = [float(part) for part in chebyshev(given_)]
    # Sums of six numbers of size one: some ulps.
    assert np.allclose(found, np.polynomial.chebyshev.poly2cheb([float(part) for part in given_]), rtol=1e-14, atol=0)


# -------------------------------------------------------------------------------------------------------- gluing
def arcs() -> tuple[dict[str, Any], list[Any], list[checker.Shown]]:
    """A claim and arcs without flights, for what is shown of their ends: Omega falls by 1 in each, from Omega_crit."""
    crit = math.sqrt(0.0475**2 * 9.81 / (0.045 * (0.227e-3 / 0.435 - 0.0025**2)))
    box = {"radii": ["0.01", "0.02"], "steps": []}
    wide = {"radii": ["0.1", "0.2"], "steps": []}
    middle = Fraction(crit).limit_denominator(10**6)
    first = {"end": "0.5", "curve": [["-2", "-1/10"], [str(middle - Fraction(1, 2)), "-1/2"]]}
    second = {"end": "1", "curve": [["-3/2", "-9/20"], [str(middle - Fraction(3, 2)), "-1/2"]]}
    entries = [{**arc, "half": ["1p0", "0p0"], "bits": 64, "box": box, "wide box": wide} for arc in (first, second)]
    claim = {
        "parameters": DISK, "amplitude_first": "0.5", "amplitude_end": "1",
        "omega_end": str(middle - 2 + Fraction(1, 50)),
        "numbers": {"omega_crit": {"value": str(middle), "uncertainty": "0.0001"}},
        "unique_within": {"v_0_per_gamma_bar_0": "0.09", "v_0": "0.09", "omega": "0.18"},
    }  # fmt: skip
    return claim, entries, [((1, -7), (1, -6))] * 2  # within 0.0078 and 0.0156


def glued(claim: Any, entries: Any, shown: Any) -> None:
    with working_precision(100):
        family_shown(claim, entries, lambda function, jobs: shown)


def test_arcs_that_fit_are_one_curve() -> None:
    glued(*arcs())


def _moved(entries: Any, number: int, row: int, by: Fraction) -> None:
    part = entries[number]["curve"][row]
    part[0] = str(Fraction(part[0]) + by)


SPOILED: dict[str, tuple[Callable[[Any, Any, Any], Any], str]] = {
    "v moved": (lambda c, e, s: _moved(e, 1, 0, Fraction(1, 10)), "not shown to be one curve"),
    "Omega moved": (lambda c, e, s: _moved(e, 1, 1, Fraction(1, 5)), "not shown to be one curve"),
    "the Hopf point": (lambda c, e, s: [_moved(e, k, 1, Fraction(1, 60)) for k in (0, 1)], "begin at the Hopf point"),
    "omega_end": (lambda c, e, s: c.update(omega_end=str(Fraction(c["omega_end"]) - Fraction(1, 100))), "omega_end"),
    "amplitude_end": (lambda c, e, s: c.update(amplitude_end="1.1"), "amplitude_end"),
    "amplitude_first": (lambda c, e, s: c.update(amplitude_first="0.4"), "amplitude_first"),
    "omega_crit": (lambda c, e, s: c["numbers"]["omega_crit"].update(value="30.9"), "omega_crit"),
    "a wider tube": (lambda c, e, s: c["unique_within"].update(v_0="0.093"), "arc 2"),
    "a wider first tube": (lambda c, e, s: c["unique_within"].update(v_0_per_gamma_bar_0="0.093"), "arc 1"),
    "a wider tube of speeds": (lambda c, e, s: c["unique_within"].update(omega="0.185"), "arc 1"),
    "no tube": (lambda c, e, s: c["unique_within"].update(v_0="0"), "arc 2"),
    "a narrow wide box": (
        lambda c, e, s: e[1]["wide box"].update(radii=["0.1", "0.01"]),
        "does not hold the other one",
    ),
    "another disk": (lambda c, e, s: c.update(parameters=parameter_texts(CALIBRATED)), "begin at the Hopf point"),
    "no disk": (lambda c, e, s: c.update(parameters={**DISK, "e": "0.05"}), "no disk's"),
    "no arcs": (lambda c, e, s: e.clear(), "no arcs"),
}


@pytest.mark.parametrize("name", SPOILED)
def test_what_does_not_fit_is_not_shown(name) -> None:
    claim, entries, shown = copy.deepcopy(arcs())
    SPOILED[name][0](claim, entries, shown)
    with pytest.raises(checker.Unproved, match=SPOILED[name][1]):
        glued(claim, entries, shown)


@pytest.mark.parametrize(("row", "by"), [(0, "0.097"), (1, "0.19")])
def test_a_cycle_that_may_lie_outside_is_not_joined(row: int, by: str) -> None:
    """The polynomials' end lies in the other arc's wide box, but the cycle, near it, may not.

    The first arc's v_0 / a is near to 1/128, so v_0 is to 1/256 where a is 1/2: 0.094 off is within 0.1.
    """
    claim, entries, shown = copy.deepcopy(arcs())
    _moved(entries, 1, 0, Fraction("0.094"))
    glued(claim, entries, shown)
    claim, entries, shown = copy.deepcopy(arcs())
    _moved(entries, 1, row, Fraction(by))
    with pytest.raises(checker.Unproved, match="one curve"):
        glued(claim, entries, shown)


def test_the_last_cycle_is_a_ball() -> None:
    """About the polynomials' end, as wide as the arc's cycles are shown to be near."""
    claim, entries, shown = arcs()
    with working_precision(100):
        omega, _, v = family_shown(claim, entries, lambda function, jobs: shown)
        for ball, row, radius in ((v, 0, Fraction(1, 128)), (omega, 1, Fraction(1, 64))):
            end = sum(Fraction(part) for part in entries[1]["curve"][row])
            assert ball.contains(steps.exact_ball(end - radius))
            assert ball.contains(steps.exact_ball(end + radius))


def test_both_boxes_and_the_signs_are_shown(monkeypatch: pytest.MonkeyPatch) -> None:
    """The signs in the narrow one; and an arc that ends where it begins, or before, is refused."""
    said: list[tuple[str, str]] = []

    class Told:
        within = (arb(0, 0.001), arb(0, 0.001))

        def __init__(self, curve: curves.Curve, entries: Any, path: str) -> None:
            self.box = f"{path} {float(curve.away[1].rad()):.2f} {float(curve.away[2].rad()):.2f}"
            said.append(("box", self.box))

        def signs(self) -> None:
            said.append(("signs", self.box))

    monkeypatch.setattr("tippedisk_verify.proofs.checker.family.Arc", Told)
    entry = arcs()[1][1]
    checker.arc_shown((DISK, Fraction("0.5"), 2, entry))
    narrow, wide = "arc 2, box 0.01 0.02", "arc 2, wide box 0.10 0.20"
    assert said == [("box", narrow), ("signs", narrow), ("box", wide)]
    for low in ("1", "1.5"):
        with pytest.raises(checker.Unproved, match="ends where it must not"):
            checker.arc_shown((DISK, Fraction(low), 2, entry))
    for name, radii in (("box", ["0", "0.02"]), ("box", ["0.01", "-0.02"]), ("wide box", ["0.1", "0"])):
        with pytest.raises(checker.Unproved, match="a radius is not positive"):
            checker.arc_shown((DISK, Fraction("0.5"), 2, entry | {name: {"radii": radii, "steps": []}}))


def test_what_is_no_arc_is_refused() -> None:
    claim, entries, shown = copy.deepcopy(arcs())
    del entries[1]["half"]
    with pytest.raises(checker.Refused, match="arc 2"):
        glued(claim, entries, shown)


# -------------------------------------------------------------------------------------------------------- certificates
def sealed(content: dict[str, Any]) -> dict[str, Any]:
    content["sha256"] = checker.digest(content)
    return content


def _axes(arc: Any) -> None:
    axes = arc["box"]["steps"][40]["axes"]
    axes[0] = axes[1]


#: In the second arc: what is spoiled, and what the checker says.
IN_THE_ARC: dict[str, tuple[Callable[[Any], Any], str]] = {
    "the curve is moved by ten radii": (
        lambda arc: _moved([arc], 0, 1, 10 * Fraction(arc["box"]["radii"][1])),
        "Krawczyk|return|move|section|stable",
    ),
    "the box is a hundred times smaller": (
        lambda arc: arc["box"].update(radii=[str(Fraction(part) / 100) for part in arc["box"]["radii"]]), "Krawczyk"
    ),
    "the box is a hundred times larger": (
        lambda arc: arc["box"].update(radii=[str(Fraction(part) * 100) for part in arc["box"]["radii"]]), "arc 2"
    ),
    "a step is three times as long": (lambda arc: _longer(arc, 3), "enclosure|return|move|section"),
    "a step is missing": (lambda arc: arc["box"]["steps"].pop(30), "return|move|section"),
    "the last step is missing": (lambda arc: arc["box"]["steps"].pop(), "ends where it must not|move"),
    "axes have no inverse": (_axes, "no inverse|enclosure|Krawczyk|upright|section"),
    "half the period is another one": (lambda arc: arc["half"].__setitem__(0, "1p0"), "return|move|section|enclosure"),
}  # fmt: skip


def _longer(arc: Any, times: int) -> None:
    step = arc["box"]["steps"][50]
    mantissa, exponent = step["share"].split("p")
    step["share"] = f"{int(mantissa, 16) * times:x}p{exponent}"


@pytest.mark.slow(minutes=4)
def test_a_certificate_is_accepted_and_what_is_tampered_with_is_not(quick) -> None:  # noqa: F811
    """Two short arcs of low degree, with one box each: they are written, shown, and spoiled one number at a time."""
    pieces = [first(PRINTED), second()]
    assert all(isinstance(piece, Piece) for piece in pieces)
    proof = BranchProof(PRINTED, tuple(pieces))
    content = json.loads(family_certificate(proof))
    known: dict[int, checker.Shown] = {}

    def mapped(function: Any, jobs: Sequence[Any]) -> list[checker.Shown]:
        for job in jobs:
            known[job[2]] = known.get(job[2]) or function(job)
        return [known[job[2]] for job in jobs]

    sentence = checker.proved(content, mapped)
    # The checker's sentence is the one that was proved, word for word.
    assert sentence == proof.statement
    disk = content["claim"]["parameters"]
    for spoil, said in IN_THE_ARC.values():
        arc = copy.deepcopy(content["evidence"]["arcs"][1])
        spoil(arc)
        with pytest.raises((checker.Unproved, checker.Refused), match=said):
            checker.arc_shown((disk, Fraction("0.1"), 2, arc))
    for other in (SUBCRITICAL, CALIBRATED):
        with pytest.raises(checker.Unproved, match="arc 2"):
            checker.arc_shown((parameter_texts(other), Fraction("0.1"), 2, content["evidence"]["arcs"][1]))
    content["claim"]["amplitude_end"] = "0.12"
    with pytest.raises(checker.Unproved, match="digest"):
        checker.proved(content, mapped)
    with pytest.raises(checker.Unproved, match="amplitude_end"):
        checker.proved(sealed(content), mapped)


@pytest.mark.slow(minutes=4)
def test_an_arc_with_merged_steps_is_never_accepted_beside_a_thread_that_cuts_series_short(quick) -> None:  # noqa: F811
    """Four of its steps merged into one: too long, as the remainder says that a shorter series has not."""
    pieces = [first(PRINTED), second()]
    content = json.loads(family_certificate(BranchProof(PRINTED, tuple(pieces))))
    disk, arc = content["claim"]["parameters"], content["evidence"]["arcs"][1]
    steps_ = arc["box"]["steps"]
    shares = [Fraction(int(x, 16)) * Fraction(2) ** int(y) for x, y in (step["share"].split("p") for step in steps_)]
    steps_[:4] = [{**steps_[3], "share": f"{int(sum(shares[:4]) * 2**200):x}p-200"}]
    begin = time.perf_counter()
    with pytest.raises(checker.Unproved, match="stay in its enclosure"):
        checker.arc_shown((disk, Fraction("0.1"), 2, arc))
    length, moments = time.perf_counter() - begin, random.Random(226)

    def meddle(wait: float, hold: float, cap: int) -> None:
        time.sleep(wait)
        before, ctx.cap = ctx.cap, cap
        time.sleep(hold)
        ctx.cap = before

    said: Counter[bool] = Counter()
    sys.setswitchinterval(1e-5)
    try:
        for _ in range(2000):
            drawn = moments.uniform(0, length), moments.uniform(0, 3e-3), moments.randint(1, 12)
            thread = threading.Thread(target=meddle, args=drawn)
            thread.start()
            with pytest.raises(checker.Unproved) as refusal:
                checker.arc_shown((disk, Fraction("0.1"), 2, arc))
            said["cut off" in str(refusal.value)] += 1
            thread.join()
    finally:
        sys.setswitchinterval(5e-3)
        ctx.cap = 10  # python-flint's own
    assert said.keys() == {True, False}  # it met both
