"""`certify orbit`: the ordinary road's cycle, or one that is given, proved."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from tippedisk_verify.commands.common import (
    Common,
    certificate_option,
    common_options,
    print_result,
    speed,
    speed_options,
)
from tippedisk_verify.errors import InputError, NoConnectionError, NoSuchCycleError, Shortfall

if TYPE_CHECKING:
    from tippedisk_verify.proofs.search.cycle import OrbitProof
    from tippedisk_verify.proofs.search.fold import FoldProof
    from tippedisk_verify.proofs.search.interval import IntervalProof

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
@click.option("--unstable", is_flag=True, help="The unstable one, where a stable one has the same speed.")
@click.option("--at-fold", is_flag=True, help="Prove a fold of the family: two of its cycles meet there and end.")
@click.option(
    "--fold", "number", type=click.IntRange(1, 20), metavar="N", help="The fold number N, if the family has several."
)
@click.option(
    "--radius", metavar="R", help="Prove the cycles of all speeds within R [rad/s] at once; numbers become ranges."
)
@certificate_option
@common_options
def orbit(
    common: Common,
    omega: str | None,
    below_crit: str | None,
    guess: tuple[str, str] | None,
    rotating: bool,
    unstable: bool,
    at_fold: bool,
    number: int | None,
    radius: str | None,
    certificate: Path | None,
) -> int:
    """Prove one limit cycle: existence, uniqueness nearby, its numbers, its stability."""
    if radius is not None and (rotating or at_fold):
        raise InputError("--radius belongs to librating cycles, and not to a fold: leave out --rotating and --at-fold")
    if at_fold:
        if omega is not None or below_crit is not None or guess is not None or unstable:
            raise InputError("--at-fold finds the speed itself: leave out the other options")
        return _fold(common, rotating, number, certificate)
    if number is not None:
        raise InputError("--fold belongs to --at-fold")
    if rotating:
        return _rotating(common, omega, below_crit, guess, unstable, certificate)
    from tippedisk_verify.proofs.search.cycle import HALF, OrbitProof, Status, prove_cycle
    from tippedisk_verify.proofs.search.interval import failed_interval, prove_interval

    parameters = common.parameters
    value = speed(common, omega, below_crit)
    unguessed = None if radius is None else failed_interval(parameters, value, radius)
    start: tuple[object, object] | None = guess
    if start is None:
        from tippedisk_verify.atlas.cycles_at_speed import cycle_at
        from tippedisk_verify.flow import default_engine

        try:
            stable = False if unstable else None
            cycle = cycle_at(parameters, value, default_engine(), digits=12, stable=stable)
        except NoSuchCycleError as fault:
            failed = unguessed or OrbitProof(HALF, Status.NO_GUESS, str(fault), parameters, value, 0)
            print_result(common, failed.to_dict())
            return 1
        start = (cycle.gamma_bar_0.value, cycle.v_0.value)
    if radius is not None:
        return _ended(common, prove_interval(parameters, value, radius, start), certificate)
    return _ended(common, prove_cycle(parameters, value, start, digits=common.digits), certificate)


def _ended(common: Common, proof: OrbitProof | FoldProof | IntervalProof, certificate: Path | None) -> int:
    """Print the result; write the certificate, if one is asked for and there is a proof."""
    if proof.proved and certificate is not None:
        from tippedisk_verify.files import write_text

        write_text(certificate, proof.certificate())
    print_result(common, proof.to_dict())
    return 0 if proof.proved else 1


def _fold(common: Common, rotating: bool, number: int | None, certificate: Path | None) -> int:
    """Prove a fold of the rotating or the librating family."""
    from tippedisk_verify.atlas.locator import locator
    from tippedisk_verify.cycles.folds import Fold, libration_folds, rotation_fold
    from tippedisk_verify.flow import default_engine
    from tippedisk_verify.proofs.kernel.claims.fold import names
    from tippedisk_verify.proofs.search.fold import HALF, TURN, FoldProof, prove_fold

    parameters, digits = common.parameters, common.digits
    parameters.refuse_smooth("folds of limit cycles are proved")
    section = TURN if rotating else HALF
    folds: tuple[Fold, ...] = ()
    fault = "no fold of this disk's limit cycles about inverted spinning was found"
    try:
        if rotating:
            folds = (rotation_fold(locator(parameters, default_engine()).rotations, digits=digits + 10),)
        else:
            folds = libration_folds(parameters, default_engine(), digits=digits + 10)
    except (NoSuchCycleError, NoConnectionError, Shortfall) as error:
        fault = str(error)
    if not folds:
        print_result(common, FoldProof(section, False, fault, parameters, 0).to_dict())
        return 1
    if number is None and len(folds) > 1:
        speeds = ", ".join(f"{fold.omega:.10g}" for fold in folds)
        raise InputError(f"this family has {len(folds)} folds, at {speeds} rad/s: choose one with --fold N, from 1 on")
    if number is not None and not 1 <= number <= len(folds):
        raise InputError(f"--fold {number}: this family has {len(folds)} fold{'s' * (len(folds) > 1)}")
    fold = folds[(number or 1) - 1]
    omega, first, second, _ = names(section)
    near = [getattr(fold, name).value for name in (first, second, omega)]
    return _ended(common, prove_fold(parameters, near, digits=digits, section=section), certificate)


def _rotating(
    common: Common,
    omega: str | None,
    below_crit: str | None,
    guess: tuple[str, str] | None,
    unstable: bool,
    certificate: Path | None,
) -> int:
    """Prove a rotating cycle."""
    from tippedisk_verify.atlas.cycles_at_speed import rotating_cycle
    from tippedisk_verify.flow import default_engine
    from tippedisk_verify.proofs.search.cycle import TURN, OrbitProof, Status, prove_cycle

    parameters, digits = common.parameters, common.digits
    value = speed(common, omega, below_crit)
    start: tuple[object, object] | None = guess
    if start is None:
        try:
            cycle = rotating_cycle(parameters, value, default_engine(), stable=not unstable)
        except NoSuchCycleError as fault:
            print_result(common, OrbitProof(TURN, Status.NO_GUESS, str(fault), parameters, value, 0).to_dict())
            return 1
        start = (cycle.beta_bar_top.value, cycle.v_top.value)
    return _ended(common, prove_cycle(parameters, value, start, digits=digits, section=TURN), certificate)
