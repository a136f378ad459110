"""The front door: the methods of a disk, seen from outside."""

from __future__ import annotations

import math
import pickle
from collections.abc import Callable
from fractions import Fraction
from typing import Any

import numpy
import pytest
from scipy.integrate import solve_ivp

import tippedisk_verify as tv
from tippedisk_verify.errors import UnknownKeywordError
from tippedisk_verify.model.parameters import SYMBOLS
from tippedisk_verify.proofs.closed_forms import proved_hopf
from tippedisk_verify.theory import one_harmonic_law, slow_manifold

DISK, START = tv.Disk("table1"), ("pi/2", "pi/2 + 0.4", 0)
LAWS = ("linear", "smooth")


# ---------------------------------------------------------------------------------- the disk itself
def test_a_disk_is_its_parameters_with_the_friction_law() -> None:
    disk, smooth = tv.Disk("table1"), tv.Disk("table1", friction="smooth")
    assert disk == tv.PRINTED
    assert hash(disk) == hash(tv.PRINTED)
    assert smooth != disk
    assert smooth.with_friction("linear") == disk
    assert smooth.changed(mu="0.4").friction == "smooth"
    assert pickle.loads(pickle.dumps(smooth)) == smooth
    mine = tv.Disk(
        r="0.045",
        e="0.0025",
        m="0.435",
        A="0.249e-3",
        B="0.227e-3",
        g="9.81",
        mu="0.3",
        epsilon="0.1",
    )
    assert (mine == disk, hash(mine) == hash(disk), mine.C, mine.name) == (
        True,
        True,
        None,
        "custom",
    )


def test_a_named_disk_with_another_number_is_no_longer_the_named_one() -> None:
    changed = tv.Disk("table1", mu="0.4", friction="smooth")
    assert changed == tv.PRINTED.changed(mu="0.4", friction="smooth")
    assert (changed.name, changed.mu, changed.C) == ("custom", Fraction("0.4"), tv.PRINTED.C)
    assert tv.Disk("table1", A="0.5e-3", C=None).C is None
    assert tv.Disk("table1", friction="smooth").name == "table1"


def test_a_text_for_a_list_is_one_number() -> None:
    assert (
        [*DISK.branch("30.4").omega]
        == [float(cycle.omega) for cycle in DISK.rotating_branch("30.4")]
        == [30.4]
    )


@pytest.mark.parametrize(
    ("speed", "choice"),
    [
        ({"omega": "30.02"}, {"rotating": True}),
        ({"omega": "30.5"}, {"rotating": True, "stable": False}),
        ({"below_crit": "0.85", "digits": 10}, {"rotating": True}),
        ({"below_het": "1e-8"}, {}),
        ({"below_het": "1e-8", "half_widths": False}, {"rotating": True}),
    ],
)
def test_a_limit_cycle_may_be_a_rotating_one(speed, choice) -> None:
    stable = choice.get("stable", True)
    assert DISK.limit_cycle(**speed, **choice) == DISK.rotating_cycle(**speed, stable=stable)


@pytest.mark.parametrize(
    ("make", "word"),
    [
        (lambda: tv.Disk("table1", nu="0.4"), "no 'nu'"),
        (lambda: tv.Disk(r="0.045"), "needs e"),
        (
            lambda: DISK.limit_cycle(),
            "one of omega, below_crit, above_het and below_het",
        ),
        (lambda: DISK.limit_cycle(above_het="1e-8", rotating=True), "give below_het"),
        (
            lambda: DISK.speed("30.4", below_het="0.5"),
            "one of omega, below_crit, above_het and below_het",
        ),
        (lambda: DISK.rhs("30.4")(0, (1.5, 1.6)), "three entries"),
        (
            lambda: DISK.certify.limit_cycle(DISK.heteroclinic().omega_h),
            "from Omega_h",
        ),
        (lambda: DISK.heteroclinic(engine="taylor"), r"Taylor\(\) or ScipyEngine\(\)"),
        (lambda: DISK.branch([]), "1 to"),
        (
            lambda: DISK.integrate("30.4", START, 1, digits=0, half_widths=False),
            "digits are a whole number",
        ),
        # a text for a list
        (lambda: DISK.branch("30.4,30.5"), None),
        (lambda: DISK.integrate("30.4", "123", 1), None),
        (lambda: DISK.integrate("30.4", START, 3, times="12"), None),
        (lambda: DISK.basin_boundary("30.5").margin("123"), None),
        *(
            (
                lambda wrong=wrong: DISK.integrate("30.4", START, 1, events=wrong),
                "not one of section, turn, surface",
            )
            for wrong in (len, "section,turn", ["turn", 1])
        ),
    ],
)
def test_invalid_arguments_give_one_line(make, word) -> None:
    with pytest.raises(tv.InputError, match=word) as fault:
        make()
    assert "\n" not in str(fault.value)


# ------------------------------------------------------------------------------------------- motion
@pytest.mark.parametrize("friction", LAWS)
def test_a_solution_agrees_with_scipys(friction) -> None:
    """Compare times, shape and numbers with `solve_ivp`'s on the disk's own right-hand side."""
    disk = tv.Disk("table1", friction=friction)
    rhs, jac = pickle.loads(pickle.dumps((disk.rhs("30.4"), disk.jacobian("30.4"))))
    start, times = [math.pi / 2, math.pi / 2 + 0.4, 0.0], numpy.linspace(0, 2, 21)
    mine = disk.integrate("30.4", START, 2, t_eval=times)
    theirs = solve_ivp(
        rhs,
        (0, 2),
        start,
        "DOP853",
        times,
        vectorized=True,
        rtol=1e-12,  # by a thousand steps below what is compared
        atol=1e-12,  # likewise: states are of order 1
    )
    assert mine.success
    assert mine.t.tolist() == theirs.t.tolist()
    assert mine.y.shape == mine.uncertainty.shape == theirs.y.shape
    # DOP853's error at this tolerance, where the smooth law's field bends
    assert abs(mine.y - theirs.y).max() < 1e-8
    assert (mine.uncertainty < 1e-11).all()  # eleven digits of states of order 1
    # The polynomial at a rounded time: its rounding times the largest rate of some hundred
    assert abs(mine(times[3]) - mine.y[:, 3]).max() < 1e-12
    assert mine(times[:4]).shape == (3, 4)
    assert mine.disk.friction == friction
    assert rhs(0.0, mine.y)[:, 7].tolist() == rhs(1.0, mine.y[:, 7]).tolist()
    assert jac(0.0, mine.y).shape == (3, *mine.y.shape)
    step, at = 1e-6, [1.2, 1.9, 0.7]
    ahead, behind = (rhs(0, (at + way * numpy.eye(3)).T) for way in (step, -step))
    # Rates of 1e4: their rounding over the step
    assert numpy.allclose(jac(0, at), (ahead - behind) / (2 * step), rtol=1e-5, atol=1e-3)


def test_a_run_that_ends_early_ends_with_its_end() -> None:
    lying = DISK.integrate("29.9", START, 20)
    assert (lying.status, lying.end.name) == (tv.Status.FLAT, "flat")
    assert lying.success
    assert "lies flat" in lying.message
    assert lying.t.shape == (lying.y.shape[1],)
    assert 17.3 < lying.end.time < 17.4
    assert abs(math.sin(lying.end.state[0])) <= lying.end.uncertainty[0]
    assert 0 < lying.end.time_uncertainty < lying.end.time / 10**12  # twelve digits
    assert numpy.isfinite(lying.uncertainty).all()
    assert (numpy.diff(lying.t) > 0).all()
    assert lying.t[-1] < lying.end.time < lying.t[-1] + 0.1
    with pytest.raises(tv.InputError, match="known from 0 s to 17"):
        lying(18.0)


@pytest.mark.parametrize("friction", LAWS)
def test_a_motion_may_begin_at_any_time(friction) -> None:
    """Check that a later start changes no state: the equations do not know the time."""
    disk, names = tv.Disk("table1", friction=friction), ("section", "turn", "surface")
    early = disk.integrate("30.4", START, 2, t_eval=[0.5, 2], events=names)
    late = disk.integrate("30.4", START, (8, 10), t_eval=[8.5, 10], events=names)
    assert late.t.tolist() == [8.5, 10.0]
    assert late.y.tolist() == early.y.tolist()
    assert (late.end.time, late.end.time_uncertainty, late.end.name) == (10.0, 0.0, "reached")
    assert late.end.state.tolist() == early.end.state.tolist()
    assert {record.name for record in late.events} == {"section", "turn", "surface"}
    for mine, theirs in zip(late.events, early.events, strict=True):
        assert abs(mine.time - 8 - theirs.time) <= mine.time_uncertainty
        assert theirs.time_uncertainty < mine.time_uncertainty < 1e-13  # some ten roundings of 10 s
        assert (mine.uncertainty < 1e-12).all()  # twelve digits of states of order 1
        assert mine.state.tolist() == theirs.state.tolist()
    assert late(8.5).tolist() == early(0.5).tolist()  # 8.5 - 8 is exact
    with pytest.raises(tv.InputError, match="known from 8 s to 10 s"):
        late(0.5)
    assert [times.shape for times in late.t_events] == [(4,), (4,), (5,)]
    assert [states.shape for states in late.y_events] == [(4, 3), (4, 3), (5, 3)]
    assert disk.integrate("30.4", START, ("10", "9.98")).t[:2].tolist() == [10.0, 9.9999]


@pytest.mark.parametrize("span", [("1e6", "1e6 + 0.1"), ("1/3", "0.3"), ("pi", "pi + 0.1")])
def test_times_are_exact(span) -> None:
    """Check states at exact times, however far from zero and whatever the doubles of the ends."""
    disk, start, end = tv.Disk("table1"), *map(tv.exact, span)
    share = (end - start) * Fraction(1, 32)
    early = disk.integrate("30.4", START, end - start, t_eval=[share, end - start], digits=20)
    late = disk.integrate("30.4", START, span, t_eval=[start + share, span[1]], digits=20)
    known = late.uncertainty
    # NumPy works with more digits than it has types for
    assert (late.y * 2.0 - 1.0).dtype == object
    assert (abs((late.y - early.y).astype(float)) <= known + early.uncertainty).all()
    assert (abs((late([start + share, end]) - late.y).astype(float)) <= known).all()
    assert late(float(start)).shape == late(late.end.time).shape == (3,)
    assert abs(float(end - late.end.time)) <= late.end.time_uncertainty
    assert len(disk.integrate("30.4", START, span).t) == 201


@pytest.mark.parametrize(
    ("named", "friction", "symbols"),
    [
        ("table1", "linear", ("e",)),
        *(
            pytest.param(named, friction, SYMBOLS, marks=pytest.mark.slow(minutes=0.3))
            for named in ("table1", "geometry")
            for friction in LAWS
        ),
    ],
)
def test_derivatives_by_parameters_hold_differences(named, friction, symbols) -> None:
    """Compare with motions to forty digits, moved by 1e-12, at the end and on the way."""
    step, times = Fraction(1, 10**12), [Fraction(1, 2), 1]
    disk = tv.Disk(named, friction=friction)
    mine = disk.integrate("30.4", START, 1, t_eval=times, variations=("state", "omega", *symbols))
    for symbol in symbols:
        value = getattr(disk, symbol)
        ahead, behind = (
            tv.Disk(named, friction=friction, **{symbol: value * (1 + sign * step)}).integrate(
                "30.4", START, 1, t_eval=times, digits=40, half_widths=False
            )
            for sign in (1, -1)
        )
        truth = ((ahead.y - behind.y) / tv.precision_of_bits(160).number(2 * step * value)).astype(
            float
        )
        slope = mine.by[symbol]
        rounding = numpy.spacing(abs(truth))  # of the truth to a double
        assert (abs(slope.y - truth) <= slope.uncertainty + rounding).all()
        assert (abs(slope.end - truth[:, -1]) <= slope.end_uncertainty + rounding[:, -1]).all()
        # Twelve digits of the motion leave eleven of its derivatives.
        assert (slope.uncertainty < 1e-11 * (1 + abs(truth))).all()
    assert numpy.array_equal(mine.by["gamma"].end, mine.transition[:, 1])
    assert numpy.array_equal(mine.by["omega"].end, mine.by_omega)
    assert set(mine.to_dict()["derivatives"]) == {"beta", "gamma", "v", "omega", *symbols}


@pytest.mark.slow
def test_derivatives_by_parameters_have_as_many_digits_as_the_motion() -> None:
    rough, sharp = (
        DISK.integrate("30.4", START, 1, digits=digits, variations="m").by["m"]
        for digits in (20, 26)
    )
    away = abs((rough.y - sharp.y).astype(float))
    assert (away <= rough.uncertainty).all()
    # Twenty digits of numbers up to ten
    assert (rough.uncertainty < 1e-19).all()


@pytest.mark.slow
def test_other_engines_and_short_motions_have_derivatives_by_parameters() -> None:
    disk, times = tv.Disk("table1"), [0.25, 0.5]
    mine, theirs = (
        disk.integrate("30.4", START, 0.5, t_eval=times, variations="B", engine=engine)
        for engine in (None, tv.ScipyEngine())
    )
    # SciPy's tolerance is relative to derivatives of order 1e3 here.
    assert abs(mine.by["B"].y - theirs.by["B"].y).max() < 1e-6
    assert numpy.isinf(theirs.by["B"].uncertainty).all()
    rest = disk.integrate("30.4", START, 0, t_eval=[0], variations="B")
    assert not rest.by["B"].end.any()


def test_arguments_of_integrate_may_be_those_of_solve_ivp() -> None:
    one = DISK.integrate("30.4", START, 1, t_eval="0.5", events="section")
    assert one.y.shape == (3, 1)
    assert DISK.integrate("30.4", START, 1, events=None).events == ()
    with pytest.raises(UnknownKeywordError, match=r"no atol: `digits` or `rtol`.*`engine`"):
        DISK.integrate("30.4", START, 1, rtol=1e-9, atol=1e-9)


# ------------------------------------------------------------------------------------- limit cycles
@pytest.mark.parametrize("friction", LAWS)
def test_an_orbit_closes_and_follows_the_equations(friction) -> None:
    """Integrate by SciPy from a quarter of the way.

    The second half is drawn by the symmetry and must be where the flow goes.
    """
    disk = tv.Disk("table1", friction=friction)
    cycle = disk.limit_cycle("30.4")
    t, y = cycle.orbit(9)
    assert t[-1] == float(cycle.period)
    assert (y[:, 0] == y[:, -1]).all()  # the second half is the first one's image
    theirs = solve_ivp(
        disk.rhs("30.4"),
        (t[2], t[-1]),
        y[:, 2],
        "DOP853",
        t[2:],
        rtol=1e-12,  # by a thousand steps below what is compared
        atol=1e-12,  # likewise: states are of order 1
    )
    # DOP853's error at this tolerance, where the smooth law's field bends
    assert abs(theirs.y - y[:, 2:]).max() < 1e-8
    _, shifted = cycle.orbit(9, shifted=True)
    # A rounding of pi/2, and one of the sum, of at most 4
    assert abs(shifted[:2] + math.pi / 2 - y[:2]).max() < 2 * 2.0**-51
    assert abs(shifted[1]).max() <= float(cycle.gamma_bar_0)


def test_a_speed_next_to_omega_h_is_accepted_as_a_speed() -> None:
    sharp = DISK.heteroclinic(digits=28).omega_h
    for way, sign in (("above_het", 1), ("below_het", -1)):
        distance = sign * (DISK.speed(**{way: "1e-12"}) - sharp.value)
        # Twelve digits of it
        assert abs(distance - Fraction("1e-12")) < Fraction("1e-24") + sharp.uncertainty


def test_a_half_width_is_formatted_so_that_it_holds() -> None:
    assert f"{tv.Measured(1, '1.21e-400').uncertainty:.2g}" == "1.3e-400"
    assert tv.Measured("1/3", 0.5) == tv.Measured.of(Fraction(1, 3), "0.5")


SMOOTH = tv.PRINTED.with_friction("smooth")


@pytest.mark.parametrize(
    "ask",
    [
        lambda: tv.hopf_point(SMOOTH),
        lambda: tv.one_harmonic(SMOOTH, "30.4"),
        lambda: one_harmonic_law.hopf_slopes(SMOOTH),
        lambda: tv.collocation_cycle(SMOOTH, "30.4"),
        lambda: tv.analyse_slow_manifold(SMOOTH, "30.4", 1),
        lambda: slow_manifold.reduced_omega_crit(SMOOTH, 1),
        lambda: proved_hopf(SMOOTH),
    ],
)
def test_results_of_the_linear_law_are_refused_under_the_smooth_one(ask) -> None:
    with pytest.raises(tv.InputError, match=r"(linear|analytic) friction law"):
        ask()


@pytest.mark.slow(minutes=0.5)
def test_results_without_half_widths_say_so_and_are_those_with_them() -> None:
    for digits in (12, 20):
        for ask in (
            lambda **how: DISK.limit_cycle("30.4", **how).period,
            lambda **how: DISK.rotating_cycle("30.02", **how).v_top,
            lambda **how: DISK.heteroclinic(**how).omega_h,
        ):
            bare, measured = ask(digits=digits, half_widths=False), ask(digits=digits)
            assert abs(bare.value - measured.value) < abs(measured.value) / 10 ** (digits - 1)
            assert (bare.is_measured, measured.is_measured) == (False, True)
            assert str(bare).endswith(" (no half-width)")
            assert bare.to_dict()["uncertainty"] is (2 * bare + 1).to_dict()["uncertainty"] is None
            with pytest.raises(tv.AccuracyError):
                assert bare > 0
    cycle = DISK.limit_cycle("30.4", half_widths=False)
    assert cycle.stable is True
    assert "(no half-width)" in repr(cycle)
    for overview in (
        DISK.branch(half_widths=False).cycles,
        DISK.rotating_branch(half_widths=False),
    ):
        assert not any(cycle.period.is_measured for cycle in overview)
    branch = DISK.branch(["30.4", "30.5"], half_widths=False)
    assert set(branch.uncertainty["period"]) == {math.inf}
    assert "(no half-width)" in str(branch)


#: Calls with an argument that names one of several things, or a file.
NAMING: dict[str, Callable[[Any], object]] = {
    "disk": lambda name: tv.Disk(name),
    "disk's own name": lambda name: tv.Disk("table1").changed(name=name),
    "friction law": lambda name: tv.Disk("table1").with_friction(name),
    "equilibrium": lambda name: tv.Disk("table1").equilibrium(name, "30.4"),
    "proved equilibrium": lambda name: tv.Disk("table1").certify.equilibrium(name, "30.4"),
    "method of Omega_h": lambda name: tv.Disk("table1").heteroclinic(method=name),
    "event": lambda name: tv.Disk("table1").integrate("30.4", (1, 2, 0), 1, events=[name]),
    "variation": lambda name: tv.Disk("table1").integrate("30.4", (1, 2, 0), 1, variations=[name]),
    "domain": lambda name: tv.Request(tv.Disk("table1"), "30.4", (1, 2, 0), 1, domain=name),
    "SciPy's method": lambda name: tv.ScipyEngine(name),
    "reference value": lambda name: tv.reference(name),
    "reading": lambda name: tv.reference("table1/linear/hopf/point/omega_crit", reading=name),
    "graded reading": lambda name: tv.compare(
        "table1/linear/hopf/point/omega_crit", 30.9, reading=name
    ),
    "problem": lambda name: tv.problem_named(name),
    "problem of a race": lambda name: tv.race({}, problems=[name]),
    "error of a race": lambda name: tv.race({}, error=name),
    "language": lambda name: tv.problem_named("cycle").source(name),
    "parameter file": lambda name: tv.Disk.read(name),
    "written parameter file": lambda name: tv.Disk("table1").to_toml(name),
    "saved result": lambda name: tv.load(name),
}


@pytest.mark.parametrize("call", NAMING.values(), ids=NAMING)
@pytest.mark.parametrize("name", [numpy.array(["a", "b"]), ["linear"], {}, 7], ids=str)
def test_what_is_no_text_names_nothing(call: Callable[[Any], object], name: object) -> None:
    with pytest.raises(tv.InputError):
        call(name)
