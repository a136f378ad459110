"""Units and definitions of the quantities in results: one table for what is shown and for the commands' help texts."""

from __future__ import annotations

from typing import NamedTuple

__all__ = ["QUANTITIES", "heading"]


class Quantity(NamedTuple):
    unit: str  #: empty for what has none
    meaning: str


QUANTITIES = {
    "omega": Quantity("rad/s", "Omega, the spinning speed"),
    "Omega": Quantity("rad/s", "the spinning speed"),
    "omega_crit": Quantity("rad/s", "Omega_crit, where inverted spinning loses its stability (the Hopf point)"),
    "omega_h": Quantity("rad/s", "Omega_h, where the two noninverted saddles are connected"),
    "reduced_omega_crit": Quantity("rad/s", "the Hopf speed of the flow on the truncated slow manifold"),
    "eigenvalues": Quantity("1/s", "of the linearisation there; re and im"),
    "kind_changes": Quantity("rad/s", "the speeds at which eigenvalues there turn from real to complex, or back"),
    "period": Quantity("s", "T, the period of the limit cycle (of hopf: its limit at Omega_crit)"),
    "gamma_bar_0": Quantity("rad", "gamma - pi/2 where beta = pi/2 and v < 0"),
    "v_0": Quantity("rad/s", "v = beta' there"),
    "beta_bar_0": Quantity("rad", "beta - pi/2 of a rotating cycle where gamma = -pi/2; v_0 is v there"),
    "beta_bar_top": Quantity("rad", "beta - pi/2 of a rotating cycle where gamma = pi/2"),
    "v_top": Quantity("rad/s", "v there"),
    "null_vector": Quantity("1/s", "d(v_0)/d(gamma_bar_0), or d(v_top)/d(beta_bar_top), along the family, at its fold"),
    "margin": Quantity(
        "rad", "distance in beta from the boundary of the basins; positive where the disk keeps standing"
    ),
    "beta_max": Quantity("rad", "largest abs(beta - pi/2) on the cycle"),
    "multiplier_slow": Quantity("", "the larger nontrivial Floquet multiplier of a full period"),
    "log_multiplier_slow": Quantity("", "its natural logarithm"),
    "log_multiplier_fast": Quantity("", "natural logarithm of the smaller one, which may be below any double"),
    "trivial_multiplier_defect": Quantity("", "distance from 1 of the computed multiplier along the flow: a check"),
    "dperiod_domega": Quantity("s^2/rad", "dT/dOmega along the family of cycles"),
    "dgamma_bar_0_domega": Quantity("s", "d(gamma_bar_0)/dOmega"),
    "dv_0_domega": Quantity("", "d(v_0)/dOmega"),
    "dbeta_bar_top_domega": Quantity("s", "d(beta_bar_top)/dOmega"),
    "dv_top_domega": Quantity("", "d(v_top)/dOmega"),
    "first_lyapunov_coefficient": Quantity("", "Kuznetsov's l_1, eigenvector of length 1 in (beta, gamma, v)"),
    "transversality": Quantity("1/rad", "d(Re lambda)/dOmega of the critical pair"),
    "amplitude_squared_slope": Quantity("rad s", "limit of beta_max^2 / (Omega_crit - Omega)"),
    "period_slope": Quantity("s^2/rad", "limit of (T - T_crit) / (Omega_crit - Omega)"),
    "quadratic_coefficient": Quantity("1/(rad s)", "c_1 of Omega = Omega_crit + c_1 a^2 + c_2 a^4, a = gamma_bar_0"),
    "quartic_coefficient": Quantity("1/(rad^3 s)", "c_2"),
    "second_lyapunov_coefficient": Quantity("", "Kuznetsov's l_2, for the same eigenvector; only where l_1 = 0"),
    "quadratic_coefficient_slope": Quantity("", "c_1' at a Bautin point, by the parameter P; all three in SI units"),
    "fold_amplitude_slope": Quantity("", "limit of a^2 / (P - value) on the fold of cycles; its sign tells the side"),
    "fold_speed_curvature": Quantity("", "limit of (Omega - Omega_crit) / (P - value)^2 on the fold"),
    "lambda_3": Quantity("1/s", "the third eigenvalue at the Hopf point"),
    "chi": Quantity("kg m^3", "the constant of the one-harmonic amplitude law"),
    "saddle_eigenvalues": Quantity("1/s", "at noninverted spinning and this speed: unstable, slow and fast stable"),
    "saddle_value": Quantity("1/s", "sum of the unstable and the slow stable one; below 0 cycles attract"),
    "splitting_derivative": Quantity("s/rad", "of the distance between the manifolds by Omega"),
    "budget": Quantity("rad/s", "what the half-width of Omega_h is made of"),
    "harmonics": Quantity("", "number of odd harmonics"),
    "beta": Quantity("rad", "the disk's inclination"),
    "gamma": Quantity("rad", "the angle of the centre of mass in the disk's plane"),
    "v": Quantity("rad/s", "beta'"),
    "h": Quantity("rad s^(n-1)/m^n", "the orders h_0, h_1, ... of v = h_0 + epsilon h_1 + ... there"),
    "residual": Quantity("m rad/s^3", "largest invariance residual of the orders 0, 1, ... over twenty fixed points"),
    "residual_slope": Quantity("", "its exponent in epsilon as epsilon tends to 0"),
    "best_order": Quantity("", "the order whose term is smallest, at its largest over those points"),
    "smallest_term": Quantity("rad/s", "the size of that term"),
}


def heading(name: str) -> str:
    """The quantity's name with its unit, if it has one."""
    unit = QUANTITIES[name].unit if name in QUANTITIES else ""
    return f"{name} [{unit}]" if unit else name
