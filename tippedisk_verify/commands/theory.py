"""The commands `equilibria`, `hopf` and `slow-manifold`: what follows from the equations without an
integrator.
"""

from __future__ import annotations

from typing import Any

import click

from tippedisk_verify.commands.definition import DiskOptions, disk_command
from tippedisk_verify.commands.options import below_crit_option, decimal_callback, omega_option

__all__ = ["COMMANDS"]

_EQUILIBRIA = ("inverted", "noninverted")


@disk_command("Compute states, eigenvalues and stability of inverted and noninverted spinning.")
@omega_option
@below_crit_option
def equilibria(common: DiskOptions, omega: str | None, below_crit: str | None) -> dict[str, Any]:
    speed = common.speed(omega, below_crit)
    return {
        name: common.disk.equilibrium(name, speed, digits=common.digits).to_dict()
        for name in _EQUILIBRIA
    }


@disk_command(
    "Compute the Hopf point: speed, period, first Lyapunov coefficient, laws of "
    "amplitude and period."
)
def hopf(common: DiskOptions) -> Any:
    return common.disk.hopf(digits=common.digits)


@disk_command("Compute the orders of the slow manifold, their residuals, and the reduced flow.")
@click.option(
    "--order",
    type=int,
    required=True,
    metavar="N",
    help="The highest order in epsilon, 0 to 40. Order 12 takes some three seconds, 20 twenty and 30 "
    "two minutes.",
)
@click.option(
    "--omega",
    callback=decimal_callback,
    metavar="X",
    help="The spinning speed [rad/s]; Omega_crit - 0.5 if not given.",
)
@click.option(
    "--beta",
    callback=decimal_callback,
    default="1.2",
    show_default=True,
    metavar="X",
    help="The angle beta at which h is evaluated [rad].",
)
@click.option(
    "--gamma",
    callback=decimal_callback,
    default="0.3",
    show_default=True,
    metavar="X",
    help="The angle gamma at which h is evaluated [rad].",
)
def slow_manifold(common: DiskOptions, order: int, omega: str | None, beta: str, gamma: str) -> Any:
    return common.disk.slow_manifold(order, omega, at=(beta, gamma), digits=common.digits)


COMMANDS = (equilibria, hopf, slow_manifold)
