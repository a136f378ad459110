"""`certify equilibria|hopf|heteroclinic` as a user meets them, and the refusals of all proofs."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import replace
from fractions import Fraction
from types import SimpleNamespace

import pytest
from flint import arb

from tests.command_line import answer
from tippedisk_verify import PRINTED, AccuracyError, InputError, Measured, Parameters
from tippedisk_verify.model.parameters import NAMED_SETS
from tippedisk_verify.proofs import angles
from tippedisk_verify.proofs.closed_forms import (
    characteristic_polynomial,
    check_linearization,
    proved_equilibrium,
    proved_hopf,
    real_root,
)
from tippedisk_verify.proofs.kernel.balls import working_precision
from tippedisk_verify.proofs.search.connection_proof import (
    MAX_DIGITS,
    ConnectionProof,
    ConnectionStatus,
    prove_connection,
)
from tippedisk_verify.proofs.search.cycle_proof import ROTATING_SECTION, prove_cycle
from tippedisk_verify.proofs.search.cycles_near_omega_h_proof import prove_cycles_near_omega_h
from tippedisk_verify.proofs.search.fold_proof import prove_fold
from tippedisk_verify.theory import hopf


def test_equilibria() -> None:
    result = answer("certify equilibria --omega 30.4 --digits 30")
    assert result["proved"] is True
    assert (result["inverted"]["stable"], result["noninverted"]["unstable_directions"]) == (
        False,
        1,
    )
    for value in result["inverted"]["eigenvalues"]:
        assert Fraction(value["re"]["uncertainty"]) <= abs(Fraction(value["re"]["value"])) / 10**27
    always = answer("certify equilibria --every-speed --friction smooth --digits 20")
    # Twenty digits of some 30 rad/s
    assert Fraction(always["omega_crit"]["uncertainty"]) < Fraction(1, 10**17)
    # The sentence stands by itself: the disk, and the numbers as above.
    for said in (
        "unstable at every Omega > 0",
        PRINTED.definition(),
        always["omega_crit"]["value"],
    ):
        assert said in always["statement"]


def test_heteroclinic_about_a_given_speed() -> None:
    result = answer("certify heteroclinic --near 30.2 --digits 4 --quiet", status=1)
    assert (result["proved"], result["status"]) == (False, "not_near")
    assert result["statement"].startswith("nothing is proved")


def test_without_python_flint_one_line_says_what_to_install() -> None:
    program = (
        "import sys; sys.modules['flint'] = None\nfrom tippedisk_verify.cli import main\n"
        "sys.exit(main(['certify', 'hopf']))"
    )
    kernel = "import sys; sys.argv, sys.modules['flint'] = ['-m'], None\nimport tippedisk_verify.proofs.kernel.__main__"
    for source, name in ((program, "tippedisk-verify: "), (kernel, "")):
        ran = subprocess.run(
            [sys.executable, "-c", source], capture_output=True, text=True, check=False
        )
        assert (ran.returncode, ran.stdout) == (2, "")
        assert ran.stderr == f"{name}proofs need python-flint: pip install '.[certify]'\n"


# ------------------------------------------------------------------------------------- closed forms
# A and Bbar too close: criticality_margin is negative.
SUBCRITICAL = PRINTED.changed(A="0.2305e-3", B="0.2290e-3")


@pytest.mark.parametrize("parameters", [*NAMED_SETS.values(), SUBCRITICAL], ids=lambda p: p.name)
def test_the_hopf_point_agrees_with_theory(parameters: Parameters) -> None:
    digits = 40
    proved, ordinary = proved_hopf(parameters, digits), hopf.hopf_point(parameters, digits)
    numbers = ("omega_crit", "period", "first_lyapunov_coefficient", "transversality")
    for name in (*numbers, "amplitude_squared_slope", "period_slope"):
        mine, theirs = getattr(proved, name), getattr(ordinary, name)
        assert mine.uncertainty * 10**digits <= abs(mine.value), name
        assert theirs.holds(mine.value), name
    assert proved.criticality == ordinary.criticality == hopf.criticality(parameters)
    assert proved.criticality in proved.statement


def test_theorem_1_is_refused_where_a_hypothesis_fails() -> None:
    """With Bbar < 0 the coefficient a2 is negative: stable above Omega_crit would be false."""
    constants = PRINTED.rational_constants()
    check_linearization(constants)
    tipped = constants._replace(Bbar=-constants.Bbar, b=-constants.b)
    assert characteristic_polynomial(tipped, Fraction(100), angles.INVERTED)[0] < 0
    for changed in (
        {"Bbar": -constants.Bbar, "b": -constants.b},
        {"e": constants.r},
        {"mu": -constants.mu},
    ):
        with pytest.raises(InputError, match="not"):
            check_linearization(constants._replace(**changed))


def test_at_a_rational_omega_crit_nothing_is_claimed() -> None:
    """(r + e)^2 g / (r b) = 1 with b = B / m - e^2: the speed 1 is Omega_crit exactly."""
    disk = PRINTED.changed(r="0.04", e="0.01", m=1, B="0.0351", A="0.036", C=None, g="0.56")
    assert hopf.omega_crit_squared(disk) == 1
    with pytest.raises(AccuracyError, match="imaginary axis"):
        proved_equilibrium(disk, 1, "inverted")
    assert proved_hopf(disk).omega_crit.holds(1)


def test_a_root_is_enclosed_for_all_coefficients_in_their_balls() -> None:
    """(x - 1) (x + 2) (x + 3) = x^3 + 4 x^2 + x - 6."""
    with working_precision(100):
        narrow = real_root((arb(4), arb(1), arb(-6)), arb(1.0001))
        assert narrow.contains(1)
        wide = real_root((arb(4, 1e-6), arb(1, 1e-6), arb(-6, 1e-6)), arb(1))
        for shift in (-1e-6, 1e-6):
            x = real_root((arb(4) + shift, arb(1) + shift, arb(-6) - shift), arb(1) - shift / 4)
            assert wide.contains(x)


# ------------------------------------------------------------------------------------ from Python
SMOOTH = PRINTED.with_friction("smooth")
#: As if it were proved; what is refused is refused before the kernel's result is used.
CONNECTION = ConnectionProof(
    ConnectionStatus.PROVED,
    Measured.of("30.0488682607", "1e-10"),
    parameters=PRINTED,
    verified=SimpleNamespace(),
)


@pytest.mark.parametrize(
    ("prove", "said"),
    [
        *(
            (lambda omega=omega: prove_cycle(PRINTED, omega, (1, -1)), None)
            for omega in ("0", "-30")
        ),
        *(
            (lambda omega=omega: prove_cycle(PRINTED, omega, (1, -1)), None)
            for omega in ("pi", "x")
        ),
        (lambda: prove_cycle(PRINTED, "30.4", (1, 2, 3)), "two components"),
        (
            lambda: prove_cycle(PRINTED, "30.06", (0.45,), section=ROTATING_SECTION),
            "two components",
        ),
        (lambda: prove_cycle(PRINTED, "30.4", ("x", -1)), "decimal"),
        (lambda: prove_fold(SMOOTH, (1, -1, 30)), "linear"),
        (lambda: prove_fold(PRINTED, (1, -1, 30), digits=0), "digits"),
        (lambda: prove_connection(PRINTED, "30", 0), "digits"),
        (lambda: prove_connection(PRINTED, "30", MAX_DIGITS + 1), "digits"),
        (lambda: prove_connection(PRINTED, "-1", 8), None),
        (
            lambda: prove_cycles_near_omega_h(replace(CONNECTION, parameters=SMOOTH)),
            "linear friction law",
        ),
        *(
            (lambda distance=distance: prove_cycles_near_omega_h(CONNECTION, distance), None)
            for distance in ("0", "-1", "pi", "2", "soon")
        ),
        (lambda: prove_cycles_near_omega_h(CONNECTION, "1e-5", "1e-5"), "between the ends"),
        (lambda: prove_cycles_near_omega_h(CONNECTION, "0.9"), "born below"),
    ],
)
def test_bad_input_of_a_proof_is_refused(prove, said: str | None) -> None:
    with pytest.raises(InputError, match=said):
        prove()
