"""`certify orbit`: the ordinary road's cycle, or one that is given, proved."""

from __future__ import annotations

import click

from tippedisk_verify.commands.common import Common, common_options, print_result, speed, speed_options
from tippedisk_verify.errors import NoSuchCycleError

__all__ = ["orbit"]


@click.command()
@speed_options
@click.option("--guess", nargs=2, metavar="GAMMA_BAR V", help="Start from this state [rad, rad/s] at beta = pi/2.")
@common_options
def orbit(common: Common, omega: str | None, below_crit: str | None, guess: tuple[str, str] | None) -> int:
    """Prove one limit cycle: existence, uniqueness nearby, its numbers, its stability."""
    from tippedisk_verify.certified.cycle import CycleProof, Status, prove_cycle

    common.parameters.refuse_smooth("limit cycles are proved")
    value = speed(common, omega, below_crit)
    if guess is None:
        from tippedisk_verify.flow import default_engine
        from tippedisk_verify.orbits.continuation import followed_cycle

        try:
            cycle = followed_cycle(common.parameters, value, default_engine(), digits=12)
        except NoSuchCycleError as fault:
            failed = CycleProof(Status.NO_GUESS, str(fault), common.parameters, value, 0)
            print_result(common, failed.json())
            return 1
        proof = prove_cycle(common.parameters, value, (cycle.gamma_bar_0.value, cycle.v_0.value), digits=common.digits)
    else:
        proof = prove_cycle(common.parameters, value, guess, digits=common.digits)
    print_result(common, proof.json())
    return 0 if proof.proved else 1
