"""A written motion: its times are exact, and its table has the numbers of the answer.

That these hold the truth is in tests/honesty/test_written_numbers.py.
"""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path

import pytest

import tippedisk_verify as tv
from tests.command_line import answer, printed, ran, rows_of
from tippedisk_verify.flow.contract import MAX_STEPS


def test_a_table_has_the_numbers_of_the_answer(tmp_path: Path) -> None:
    table = tmp_path / "motion.csv"
    found = answer(f"integrate --omega 30.4 --state 1.2,2,0 --time 1/3 --times 4 --out {table}")
    rows = rows_of(table)
    assert [row["t"] for row in rows] == found["t"]
    assert found["end"]["t"]["uncertainty"] == "0"
    for name in ("beta", "gamma", "v"):
        assert found[name] == [
            {"value": row[name], "uncertainty": row[f"{name}_uncertainty"]} for row in rows
        ]


def test_even_times_are_exact_and_doubles_are_written_in_full() -> None:
    disk, state = tv.Disk("table1"), ("1.2", 2, 0)
    even = disk.integrate("30.4", state, "0.3")
    assert even.to_dict()["t"][:3] == ["0", "0.0015", "0.003"]
    assert even.times[1].rational == Fraction(3, 2000)
    double = disk.integrate("30.4", state, "0.3", t_eval=[0.1])
    assert double.to_dict()["t"] == ["0.1000000000000000055511151231257827021181583404541015625"]
    (third,) = disk.integrate("30.4", state, "1/3", t_eval=["1/3"]).to_dict()["t"]
    assert abs(Fraction(third) - Fraction(1, 3)) < Fraction(1, 10**49)  # fifty decimals


@pytest.mark.parametrize("friction", ["linear", "smooth"])
@pytest.mark.slow
def test_half_widths_hold_the_error_that_a_tolerance_leaves(friction: tv.Friction) -> None:
    disk, start = tv.Disk("table1", friction=friction), ("1.3", "2.2", 6)
    true = disk.integrate("30.4", start, 3, digits=25, events="section")
    errors = []
    for rtol in (1e-2, 1e-5, "1e-9"):
        sol = disk.integrate("30.4", start, 3, rtol=rtol, events="section")
        error = abs(sol.y - true.y.astype(float))
        assert (error <= sol.uncertainty + 2.0**-50).all()
        # The estimate of the error and a quarter of it, or all of it, again
        assert (sol.uncertainty.max(axis=1) <= 2.5 * error.max(axis=1) + 2.0**-50).all()
        for mine, exact in zip(sol.events, true.events, strict=True):
            assert abs(float(mine.time) - float(exact.time)) <= mine.time_uncertainty + 2.0**-50
        errors.append(error.max())
    assert errors[0] > 100 * errors[1] > 1e4 * errors[2] > 0
    for options, said in (
        ({"rtol": 1e-6, "digits": 20}, "either rtol or digits"),
        ({"rtol": 2}, "between 0 and 1"),
        ({"rtol": "x"}, "x"),
    ):
        with pytest.raises(tv.InputError, match=said):
            disk.integrate("30.4", start, 3, **options)


@pytest.mark.parametrize(("digits", "friction"), [(12, "linear"), (12, "smooth"), (20, "linear")])
def test_missing_half_widths_are_marked(digits: int, friction: tv.Friction) -> None:
    disk, start = tv.Disk("table1", friction=friction), ("1.2", 2, 0)
    bare = disk.integrate("30.4", start, "0.7", digits=digits, events="section", half_widths=False)
    measured = disk.integrate("30.4", start, "0.7", digits=digits, events="section")
    assert bare.message.endswith("without half-widths")
    assert {float(width) for width in bare.uncertainty.ravel()} == {float("inf")}
    assert [time.rational for time in bare.times] == [time.rational for time in measured.times]
    for mine, true in zip(bare.y.ravel(), measured.y.ravel(), strict=True):
        # The digits asked for, of numbers up to 10
        assert abs(float(tv.exact(mine).rational - tv.exact(true).rational)) < 10.0 ** -(digits - 1)
    entries = bare.to_dict()
    assert (
        {one["uncertainty"] for one in entries["beta"]}
        == {entries["events"][0]["t"]["uncertainty"]}
        == {None}
    )
    words = f"integrate --omega 30.4 --state 1.2,2,0 --time 0.7 --no-half-widths --friction {friction} --json"
    assert "without half-widths" in ran(words.split()).err


# ------------------------------------------------------------------------ what a run says of itself
def test_a_run_that_needs_more_steps_is_reported_at_once() -> None:
    disk, state = tv.Disk("table1"), ("pi/2", "pi/2 + 0.4", 0)
    short = disk.integrate("30.4", state, 10, max_steps=20)
    assert (short.status, short.success) == (tv.Status.STEP_LIMIT, False)
    assert "raise max_steps" in short.message
    assert disk.integrate("30.4", state, 10, max_steps=MAX_STEPS).success
    printed("integrate --omega 30.4 --state pi/2,2,0 --time 10 --max-steps 20", status=1)
    with pytest.raises(tv.InputError, match="max_steps"):
        disk.integrate("30.4", state, 10, max_steps=0)


@pytest.mark.parametrize(
    ("state", "shifted", "noted"),
    [
        ((90, 100, 0), False, "beta = 90"),
        ((0, 180, 0), True, "gamma_bar = 180"),
        (("1.2", "-270", 0), False, "gamma = -270"),
        (("1.2", "99", 0), False, ""),
        (("pi/2", "5*pi/2", 0), False, ""),
    ],
)
def test_angles_that_may_be_degrees_are_noted(
    state: tuple[object, ...], shifted: bool, noted: str
) -> None:
    solution = tv.Disk("table1").integrate("30.4", state, "0.01", shifted=shifted)
    assert (noted in solution.note, bool(solution.note), solution.success) == (
        True,
        bool(noted),
        True,
    )
    assert solution.message.endswith(solution.note)
    if not shifted:
        words = f"integrate --omega 30.4 --time 0.01 --json --state {','.join(map(str, state))}"
        assert ("radians" in ran(words.split()).err) == bool(noted)


@pytest.mark.parametrize("name", ["section", "turn", "surface"])
def test_an_event_keeps_its_requested_name(name: str) -> None:
    found = tv.Disk("table1").integrate("30.4", ("pi/2", 2, 0), 2, events=name).events
    assert {record.name for record in found} == {name}


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"direction": 2}, "direction is -1, 0 or 1, not 2"),
        ({"direction": "up"}, "not up"),
        ({"function": lambda t, y: y[0] - t}, "(t, y) made of arithmetic on y"),
        (
            {"function": lambda t, y: __import__("numpy").cos(y[0])},
            "ops, constants, omega, beta, gamma, v",
        ),
        (
            {"function": lambda ops, c, omega, beta, gamma, v: __import__("math").cos(beta)},
            "ops.sin and ops.cos",
        ),
        (
            {"function": lambda ops, c, omega, beta, gamma, v: __import__("numpy").cos(beta)},
            "ops.sin and ops.cos",
        ),
        ({"function": lambda ops, c, omega, beta, gamma, v: ops.exp(beta)}, "ops.sin and ops.cos"),
        ({"function": lambda ops, c, omega, beta, gamma, v: c.radius * v}, "ops.sin and ops.cos"),
        ({"function": 3}, "ops.sin and ops.cos"),
    ],
)
def test_an_invalid_event_is_refused_with_a_remedy(
    arguments: dict[str, object], message: str
) -> None:
    right = {
        "function": lambda ops, c, omega, beta, gamma, v: (
            c.r * ops.cos(beta) ** 2 - 1 / omega + v * gamma
        )
    }
    assert tv.Event("fine", **right).direction == 0
    with pytest.raises(tv.InputError) as refused:
        tv.Event("x", **(right | arguments))
    assert message in str(refused.value)
    assert "\n" not in str(refused.value)


def test_events_in_scipys_form_agree_with_ours() -> None:
    disk, start = tv.Disk("table1"), ("pi/2", 2, 0)
    scipys = tv.Event("crossing", lambda t, y: 2 * y[0] - 3.2 + y[2] ** 2, terminal=False)
    ours = tv.Event(
        "crossing", lambda ops, c, omega, beta, gamma, v: 2 * beta - 3.2 + v**2, terminal=False
    )
    found, expected = (
        disk.integrate("30.4", start, 2, events=event).t_events[0] for event in (scipys, ours)
    )
    assert len(found) > 2
    assert (found == expected).all()


@pytest.mark.parametrize("decimals", [12, 25, 30, 40])
def test_a_start_within_rounding_of_the_surface_has_half_widths(decimals: int) -> None:
    """Start under the smooth law with v on the surface gamma_y = 0 except for its last decimals."""
    import mpmath

    disk = tv.Disk("table1", friction="smooth")
    with mpmath.workdps(60):
        beta, gamma, r, e = (mpmath.mpf(text) for text in ("1.1", "0.7", "0.045", "0.0025"))
        v = (
            e
            * mpmath.mpf("30.4")
            * mpmath.sin(beta)
            * mpmath.cos(gamma)
            / (r + e * mpmath.sin(gamma))
        )
        text = mpmath.nstr(v, decimals)
    found = disk.integrate("30.4", ("1.1", "0.7", text), 1, events="surface")
    truth = disk.integrate("30.4", ("1.1", "0.7", text), 1, digits=24)
    # Twelve digits of states of size 1 to 10
    assert max(map(float, found.uncertainty.ravel())) < 10 * 1e-12
    for mine, width, true in zip(
        found.y[:, -1], found.uncertainty[:, -1], truth.y[:, -1], strict=True
    ):
        assert abs(tv.exact(mine).rational - tv.exact(true).rational) <= Fraction(
            float(width)
        ) + Fraction(1, 10**22)
