"""The kinds of reference entries, in order of difficulty."""

from __future__ import annotations

from tippedisk_verify.errors import InputError
from tippedisk_verify.reference_values import cycle_roads, local_roads, motion_roads, places, rotation_roads
from tippedisk_verify.reference_values.entries import Kind

__all__ = ["KINDS", "kind_named"]


def _rhs_unit(quantity: str) -> str:
    return {
        "M": "kg m^2", "h": "N m", "f_G": "N m", "w_y": "m", "gamma_y": "m/s", "gamma_rate": "rad/s", "lambda_Ty": "N",
        "v_rate": "rad/s^2", "dv_rate_dbeta": "1/s^2", "dv_rate_dgamma": "1/s^2", "dv_rate_dv": "1/s",
    }[quantity]  # fmt: skip


def _hopf_unit(quantity: str) -> str:
    return {
        "omega_crit": "rad/s", "period": "s", "transversality": "1/rad", "amplitude_squared_slope": "rad s",
        "period_slope": "s^2/rad", "first_lyapunov_coefficient": "1",
    }[quantity]  # fmt: skip


def _balance_unit(quantity: str) -> str:
    return {"amplitude": "rad", "frequency": "rad/s", "period": "s"}[quantity]


def _manifold_unit(quantity: str) -> str:
    name, order = quantity.rsplit("_", 1)
    if name == "residual":
        return "m rad/s^3"
    return "rad/s" if order == "0" else "rad/m" if order == "1" else f"rad s^{int(order) - 1}/m^{order}"


KINDS: tuple[Kind, ...] = (
    Kind("rhs", 1, "Right-hand side of the equations of motion, its parts, and its Jacobian", _rhs_unit,
         places.rhs, local_roads.RHS, local_roads.rhs_condition, chunk=150),
    Kind("equilibrium", 2, "Eigenvalues of inverted and noninverted spinning", lambda name: "1/s",
         places.equilibria, local_roads.EQUILIBRIUM, local_roads.equilibrium_condition, chunk=16),
    Kind("hopf", 3, "The Hopf point: speed, period, first Lyapunov coefficient, slopes", _hopf_unit,
         places.hopfs, local_roads.HOPF, local_roads.hopf_condition),
    Kind("harmonic-balance", 4, "The one-harmonic law, as the paper prints it and made consistent", _balance_unit,
         places.harmonic_balances, local_roads.BALANCE, local_roads.balance_condition, chunk=8),
    Kind("slow-manifold", 5, "Orders h_0 to h_5 of the slow manifold, and the residuals of the truncated series",
         _manifold_unit, places.slow_manifolds, local_roads.MANIFOLD, local_roads.manifold_condition, chunk=5),
    Kind("trajectory", 6, "The six scenes' orbits over 10 s, sampled, with their crossings of beta = pi/2",
         motion_roads.trajectory_unit, places.trajectories, motion_roads.TRAJECTORY, motion_roads.trajectory_condition),
    Kind("limit-cycle", 7, "Limit cycles with multipliers and sensitivities", cycle_roads.cycle_unit,
         places.cycles, cycle_roads.CYCLE, cycle_roads.cycle_condition),
    Kind("heteroclinic", 8, "Omega_h and the saddle's eigenvalues there", cycle_roads.cycle_unit,
         places.heteroclinics, cycle_roads.HETEROCLINIC, cycle_roads.heteroclinic_condition, digits=102),
    Kind("near-heteroclinic", 9, "Limit cycles at Omega_h + 10^-k", cycle_roads.cycle_unit,
         places.near_heteroclinics, cycle_roads.NEAR, cycle_roads.near_condition),
    Kind("rotating-cycle", 10, "Rotating limit cycles, stable and unstable, with multipliers and sensitivities",
         rotation_roads.rotation_unit, places.rotations, rotation_roads.ROTATION, rotation_roads.rotation_condition),
    Kind("rotation-fold", 10, "The fold of the rotating limit cycles, their lowest speed", rotation_roads.rotation_unit,
         places.rotation_folds, rotation_roads.FOLD, rotation_roads.fold_condition),
)  # fmt: skip


def kind_named(name: str) -> Kind:
    """The kind of that name. Raises InputError if there is none."""
    for kind in KINDS:
        if kind.name == name:
            return kind
    raise InputError(f"kind '{name[:40]}' is not known: use {', '.join(kind.name for kind in KINDS)}")
