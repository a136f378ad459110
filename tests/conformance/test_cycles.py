"""What is said of planted faults in cycles and the connection under the linear law; two of them stay unnamed."""

from __future__ import annotations

import re

import pytest

from tests.conformance.faults import Graders

CYCLE = '    return {\n        "period": 2 * half,'
STATES = """    start = [HALF_PI, HALF_PI + x[0], x[1]]
    orbit = integrate(lambda y: rates(p, Omega, smooth, y), start, [0, 0.01, half / 2])
"""
MATRIX = "lambda_u, lambda_s, lambda_ss = [z.real for z in spectrum(p, Omega, smooth, -HALF_PI)]"
#: What is planted, and what has to be said; nothing is said of the last two.
FAULTS = {
    "beta_max at a quarter of the period": (
        [(CYCLE, STATES + CYCLE), ("HALF_PI - deepest", "HALF_PI - orbit[2, 0]")],
        "^beta_max: the deflection a quarter of a period after the section is taken$",
    ),
    "state beside the section": (
        [(CYCLE, STATES + "    x = [orbit[1, 1] - HALF_PI, orbit[1, 2]]\n" + CYCLE)],
        "^gamma_bar_0, v_0: states of the right cycles up to 10 ms after the section, not on it$",
    ),
    "the divergence without 1/M": (
        [("*change, vv]", "*change, vv * model(math, p, Omega, smooth, *s)[0]]")],
        "^log_multiplier_fast: the divergence's integral has no factor 1/M$",
    ),
    "a source by Omega with a factor": (
        [("source = (gO, vO)", "source = (gO, 0.7 * vO)")],
        r"^dv'/dOmega is 0\.7 times as large in the variational equations by Omega$",
    ),
    "a share of the derivative twice": (
        [("dtime[:2] @ by_Omega + dtime[2]", "dtime[0] * by_Omega[0] + 1.5 * dtime[1] * by_Omega[1] + dtime[2]")],
        r"^dperiod_domega has v_0's share 1\.5 times$",
    ),
    "logarithms per revolution": (
        [('"log_multiplier_slow": math.log(slow)', '"log_multiplier_slow": math.log(slow) * math.pi / Omega / half')],
        "^log_multiplier_slow: the answers are 2 pi Omega",
    ),
    "the saddle's index": (
        [('"lambda_s": lambda_s,', '"lambda_s": -lambda_s / lambda_u,')],
        "^lambda_s: minus lambda_s/lambda_u is answered$",
    ),
    "half the damping at the saddle": (
        [(MATRIX, "J = jacobian(p, Omega, smooth, [HALF_PI, -HALF_PI, 0.0])\n    J[2, 2] /= 2\n"
          "    lambda_ss, lambda_s, lambda_u = sorted(np.linalg.eigvals(J).real)")],
        r"^in the saddle's matrix dv'/dv is 0\.5 times as large$",
    ),
    "orbits followed too shortly": (
        [("np.arange(0, 10, 0.01)", "np.arange(0, 3.3, 0.01)")],
        r"^the search for Omega_h follows orbits for 3\.29 s only, too short",
    ),
    "an eigenvalue of two changes": ([('"lambda_s": lambda_s,', '"lambda_s": 1.01 * lambda_s / lambda_u + 0.02,')], ""),
    "a divergence of two changes": ([("*change, vv]", "*change, 1.1 * vv + 0.3 * gb]")], ""),
}  # fmt: skip


@pytest.fixture(scope="module")
def graders(tmp_path_factory: pytest.TempPathFactory) -> Graders:
    graders = Graders(tmp_path_factory.mktemp("cycles"))
    graders.rows = [row for row in graders.rows if row["level"] in "78" and row["friction"] == "linear"]
    return graders


@pytest.mark.parametrize("name", FAULTS)
def test_a_fault_in_cycles_is_named_or_left_alone(name: str, graders: Graders) -> None:
    patches, words = FAULTS[name]
    row = graders({"name": name, "first": 8, "patches": patches})
    assert row["level"] in (7, 8)
    assert len(row["statements"]) == bool(words)
    assert all(re.search(words, statement) for statement in row["statements"])
