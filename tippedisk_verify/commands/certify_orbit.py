"""`certify orbit`: the ordinary road's cycle, or one that is given, proved."""

from __future__ import annotations

import click

from tippedisk_verify.commands.common import Common, common_options, print_result, speed, speed_options
from tippedisk_verify.errors import InputError, NoSuchCycleError

__all__ = ["orbit"]


@click.command()
@speed_options
@click.option(
    "--guess",
    nargs=2,
    metavar="GAMMA_BAR V",
    help="Start from this state [rad, rad/s] at beta = pi/2; of a rotating cycle beta_bar and v at gamma = pi/2.",
)
@click.option("--rotating", is_flag=True, help="The cycle on which gamma grows by 2 pi a period.")
@click.option("--unstable", is_flag=True, help="Of the rotating cycles, the unstable one.")
@click.option("--at-fold", is_flag=True, help="Prove where the stable and the unstable rotating cycles meet.")
@common_options
def orbit(
    common: Common,
    omega: str | None,
    below_crit: str | None,
    guess: tuple[str, str] | None,
    rotating: bool,
    unstable: bool,
    at_fold: bool,
) -> int:
    """Prove one limit cycle: existence, uniqueness nearby, its numbers, its stability."""
    if rotating:
        return _rotating(common, omega, below_crit, guess, unstable, at_fold)
    if unstable or at_fold:
        raise InputError("--unstable and --at-fold belong to --rotating")
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


def _rotating(
    common: Common,
    omega: str | None,
    below_crit: str | None,
    guess: tuple[str, str] | None,
    unstable: bool,
    at_fold: bool,
) -> int:
    """Prove a rotating cycle, or the fold of their family."""
    from tippedisk_verify.certified.cycle import Status
    from tippedisk_verify.certified.rotation import RotationProof, prove_rotation
    from tippedisk_verify.certified.rotation_fold import prove_rotation_fold
    from tippedisk_verify.flow import default_engine
    from tippedisk_verify.orbits.folds import rotation_fold
    from tippedisk_verify.orbits.rotating import rotating_cycle

    parameters, digits = common.parameters, common.digits
    parameters.refuse_smooth("rotating cycles are proved")
    if at_fold:
        if omega is not None or below_crit is not None or guess is not None or unstable:
            raise InputError("--at-fold finds the speed itself: leave out the other options")
        fold = rotation_fold(parameters, default_engine(), digits=digits + 10)
        state = (fold.beta_bar_top.value, fold.v_top.value, fold.omega.value)
        proved = prove_rotation_fold(parameters, *state, digits=digits)
        print_result(common, proved.json())
        return 0 if proved.proved else 1
    value = speed(common, omega, below_crit)
    if guess is None:
        try:
            cycle = rotating_cycle(parameters, value, default_engine(), stable=not unstable)
        except NoSuchCycleError as fault:
            print_result(common, RotationProof(Status.NO_GUESS, str(fault), parameters, value, 0).json())
            return 1
        proof = prove_rotation(parameters, value, (cycle.beta_bar_top.value, cycle.v_top.value), digits=digits)
    else:
        proof = prove_rotation(parameters, value, guess, digits=digits)
    print_result(common, proof.json())
    return 0 if proof.proved else 1
