"""What each quantity is, in a sentence. docs/grading.md has the same sentences, and the equations that they name."""

from __future__ import annotations

import re

__all__ = ["DEFINITIONS", "definition"]

_CYCLE = {
    "period": "T, the time after which the state comes back",
    "gamma_bar_0": "gamma - pi/2 where the cycle passes beta = pi/2 with v < 0",
    "v_0": "v at that point",
    "beta_max": "the largest abs(beta - pi/2) on the cycle",
    "multiplier_slow": "the larger of the two Floquet multipliers besides 1, over one period",
    "log_multiplier_slow": "its natural logarithm",
    "log_multiplier_fast": "the natural logarithm of the smaller one;"
    " both logarithms add up to the integral of d(v')/dv over a period",
    "dperiod_domega": "dT/dOmega along the family of cycles",
    "dgamma_bar_0_domega": "d(gamma_bar_0)/dOmega along the family",
    "dv_0_domega": "d(v_0)/dOmega along the family",
}
_ROTATION = {
    "period": "time in which gamma grows by 2 pi",
    "beta_bar_0": "beta - pi/2 > 0 where gamma = -pi/2 modulo 2 pi, next to the saddle",
    "v_0": "v where gamma = -pi/2 modulo 2 pi",
    "beta_bar_top": "beta - pi/2 > 0 where gamma = pi/2 modulo 2 pi",
    "v_top": "v where gamma = pi/2 modulo 2 pi",
    "beta_max": "the largest beta - pi/2 on the cycle",
    "multiplier_slow": "the larger of the two Floquet multipliers besides 1, over one period",
    "log_multiplier_slow": "its natural logarithm: below 0 on stable cycles, above 0 on unstable ones",
    "log_multiplier_fast": "the natural logarithm of the smaller one",
    "dperiod_domega": "dT/dOmega along the family",
    "dbeta_bar_top_domega": "d(beta_bar_top)/dOmega along the family",
    "dv_top_domega": "d(v_top)/dOmega along the family",
    "omega": "the speed of the fold, where multiplier_slow is 1",
    "null_vector": "d(v_top)/d(beta_bar_top) along the family at its fold",
}
#: By kind, then by name; ``n`` stands for a number in it, ``@t`` and ``#n`` are left out.
DEFINITIONS: dict[str, dict[str, str]] = {
    "rhs": {
        "M": "the inertia that v' is multiplied by, positive",
        "h": "the gyroscopic force",
        "f_G": "the force of gravity",
        "w_y": "the lever of the friction force",
        "gamma_y": "the velocity at which the contact point slides",
        "gamma_rate": "gamma'",
        "lambda_Ty": "the friction force, by the linear or the smooth law",
        "v_rate": "v' = beta''",
        "dv_rate_dbeta": "the partial derivative of v' by beta, at fixed gamma, v and Omega",
        "dv_rate_dgamma": "the partial derivative of v' by gamma",
        "dv_rate_dv": "the partial derivative of v' by v",
    },
    "equilibrium": {
        "lambda_n_re": "real part of the n-th eigenvalue of the linearised equations, by descending real part,"
        " then by descending imaginary part",
        "lambda_n_im": "its imaginary part",
    },
    "hopf": {
        "omega_crit": "the speed at which a pair of eigenvalues of inverted spinning lies on the imaginary axis",
        "period": "2 pi over the imaginary part of that pair",
        "first_lyapunov_coefficient": "Kuznetsov's l_1, with an eigenvector of length 1 in (beta, gamma, v) and"
        " the factor 1/(2 omega)",
        "transversality": "d(Re lambda)/dOmega of the pair",
        "amplitude_squared_slope": "limit of beta_max^2 / (Omega_crit - Omega) on the limit cycles",
        "period_slope": "limit of (T - T_crit) / (Omega_crit - Omega) on the limit cycles",
    },
    "harmonic-balance": {
        "amplitude": "C of the one-harmonic law, the amplitude of beta - pi/2",
        "frequency": "omega of the one-harmonic law, the angular frequency",
        "period": "2 pi / omega",
    },
    "slow-manifold": {
        "h_n": "the n-th order h_n of v = h_0 + epsilon h_1 + epsilon^2 h_2 + ... on the slow manifold",
        "residual_n": "what the series cut off after order n leaves of the invariance equation,"
        " epsilon (dh/dbeta h - dh/dgamma Omega cos(beta) - v')",
    },
    "trajectory": {
        "beta": "beta at the time t after the start",
        "gamma": "gamma at the time t, without whole turns taken off",
        "v": "v at the time t",
        "crossing_time": "time of the n-th crossing of beta = pi/2, in either direction;"
        " those in the first 0.01 s do not count",
        "crossing_gamma": "gamma at that crossing",
        "crossing_v": "v at that crossing",
        "flat_time": "when the disk lies flat, sin(beta) = 0; the run ends there",
    },
    "limit-cycle": _CYCLE,
    "near-heteroclinic": _CYCLE,
    "heteroclinic": {
        "omega_h": "the speed at which an orbit joins the saddles (pi/2, -pi/2, 0) and (pi/2, 3 pi/2, 0)",
        "lambda_u": "the positive eigenvalue of the saddle at that speed",
        "lambda_s": "the negative one nearer to 0",
        "lambda_ss": "the negative one farther from 0",
    },
    "rotating-cycle": _ROTATION,
    "rotation-fold": _ROTATION,
}  # fmt: skip


def definition(kind: str, quantity: str) -> str:
    """What a quantity of that kind is, by its name with or without a place."""
    name = re.split("[@#]", quantity)[0]
    of_kind = DEFINITIONS[kind]
    return of_kind[name] if name in of_kind else of_kind[re.sub(r"(?<=_)\d+(?=_|$)", "n", name)]
