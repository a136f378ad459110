"""The commands of `certify`: numbers with a proof by ball arithmetic, and the check of a certificate.

Exit status 0: proved; 1: not proved, and the status says where the proof stopped; 2: bad input.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from tippedisk_verify.commands.common import (
    Common,
    alone_in,
    certificate_option,
    common_options,
    executor_option,
    jobs_option,
    plain_options,
    print_result,
    processes,
    speed_options,
    workers_of,
)
from tippedisk_verify.errors import AccuracyError, InputError
from tippedisk_verify.model.results import result_lines

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

__all__ = ["COMMANDS"]


@click.group(invoke_without_command=True)
@click.pass_context
def certify(context: click.Context) -> None:
    """Prove numbers: enclosures by ball arithmetic, each with the statement proved."""
    if context.invoked_subcommand is None:
        click.echo(context.get_help())


@certify.command()
@click.option("--every-speed", is_flag=True, help="Prove stability at every speed instead, and Omega_crit.")
@common_options
@speed_options
def equilibria(common: Common, every_speed: bool, omega: str | None, below_crit: str | None) -> dict[str, Any]:
    """Prove eigenvalues and stability of inverted and noninverted spinning (both friction laws)."""
    prover, digits = common.disk.certify, common.digits
    if every_speed:
        if omega is not None or below_crit is not None:
            raise InputError("--every-speed takes the place of --omega and --below-crit")
        return {"proved": True, **prover.stability(digits=digits).to_dict()}
    speed = common.speed(omega, below_crit)
    names = ("inverted", "noninverted")
    return {"proved": True, **{name: prover.equilibrium(name, speed, digits=digits).to_dict() for name in names}}


@certify.command()
@common_options
def hopf(common: Common) -> dict[str, Any]:
    """Prove the Hopf point: where it is, its normal form, and on which side the limit cycles are."""
    return {"proved": True, **common.disk.certify.hopf(digits=common.digits).to_dict()}


@certify.command()
@click.option(
    "--guess",
    nargs=2,
    metavar="GAMMA_BAR V",
    help="Start from this state [rad, rad/s] at beta = pi/2; of a rotating cycle beta_bar and v at gamma = pi/2.",
)
@click.option("--rotating", is_flag=True, help="The cycle on which gamma grows by 2 pi a period.")
@click.option("--unstable", is_flag=True, help="The unstable one, where a stable one has the same speed.")
@click.option("--at-fold", is_flag=True, help="Prove a fold of the family: two of its cycles meet there and end.")
@click.option("--fold", "number", type=click.IntRange(1, 20), metavar="N", help="Its number, if there are several.")
@click.option(
    "--radius", metavar="R", help="Prove the cycles of all speeds within R [rad/s] at once; numbers become ranges."
)
@certificate_option
@common_options
@speed_options
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
) -> Any:
    """Prove one limit cycle: existence, uniqueness nearby, its numbers, its stability."""
    prover, digits = common.disk.certify, common.digits
    if radius is not None and (rotating or at_fold):
        raise InputError("--radius belongs to librating cycles, and not to a fold: leave out --rotating and --at-fold")
    if number is not None and not at_fold:
        raise InputError("--fold belongs to --at-fold")
    if at_fold:
        if omega is not None or below_crit is not None or guess is not None or unstable:
            raise InputError("--at-fold finds the speed itself: leave out the other options")
        return _written(prover.fold(number, rotating=rotating, digits=digits), certificate)
    speed, how = common.speed(omega, below_crit), {"stable": False if unstable else None, "guess": guess}
    if radius is not None:
        return _written(prover.limit_cycles(speed, radius, **how), certificate)
    return _written(prover.limit_cycle(speed, rotating=rotating, digits=digits, **how), certificate)


@certify.command()
@click.option("--near", metavar="X", help="Prove it about this speed [rad/s]; about the computed Omega_h if not given.")
@click.option(
    "--cycles",
    metavar="D",
    help="Prove also the limit cycle of every speed up to D [rad/s] above Omega_h (rounded to 4 decimals).",
)
@certificate_option
@common_options
def heteroclinic(common: Common, near: str | None, cycles: str | None, certificate: Path | None) -> Any:
    """Prove Omega_h in an interval no longer than 10^-DIGITS, and that it is the only one there."""
    prover, how = common.disk.certify, {"digits": common.digits, "progress": not common.quiet}
    if cycles is None:
        return _written(prover.heteroclinic(near, **how), certificate)
    end = _written(prover.beside_omega_h(cycles, near, **how), certificate)
    print_result(common, end.connection.to_dict() | {"cycles": end.to_dict()})
    return 0 if end.proved else 1


def _written(proof: Any, certificate: Path | None) -> Any:
    """The proof; its certificate is written, if one is asked for and there is a proof."""
    if proof.proved and certificate is not None:
        from tippedisk_verify.files import write_text

        write_text(certificate, proof.certificate())
    return proof


@certify.command()
@click.option("--to", "until", metavar="X", help="Only to this gamma_bar_0 [rad], without the end at Omega_h.")
@click.option("--out", metavar="DIR", help="Write a picture of what is proved there.")
@certificate_option
@executor_option
@jobs_option
@common_options
def branch(
    common: Common, until: str | None, out: str | None, certificate: Path | None, executor: str, jobs: int | None
) -> int:
    """Prove the family of limit cycles from the Hopf point to the heteroclinic cycle: one curve, stable, Omega falls.

    It takes some 6 minutes of CPU. Every worker of a cluster needs this version of the package. `branch --proved`
    proves the cycles at single speeds one by one.
    """
    from tippedisk_verify.files import write_text

    def workers(several: bool) -> Any:
        return workers_of(executor, jobs, needed=several)

    folder = alone_in(out)
    with workers(False):
        pass  # a cluster that is not there is told at once
    proof = common.disk.certify.branch(until, workers=workers, progress=not common.quiet)
    if certificate is not None and proof.hopf_closed:
        write_text(certificate, proof.certificate())
    if folder is not None and proof.hopf_closed:
        from tippedisk_verify.figures.proved_family import draw_proved_family
        from tippedisk_verify.figures.style import save

        save(draw_proved_family(proof), folder, "proved_family")
    entries = proof.to_dict()
    shown = {name: len(proof.pieces) if name == "arcs" else entry for name, entry in entries.items()}
    print_result(common, entries, result_lines(shown))
    return 0 if proof.proved else 1


@certify.command()
@click.argument("file")
@jobs_option
@plain_options
def check(common: Common, file: str, jobs: int | None) -> int:
    """Replay a certificate: its choices are tested again, without the search that found them.

    A family of limit cycles takes some four minutes of CPU, all else less than one.
    """
    from tippedisk_verify.progress import watched
    from tippedisk_verify.proofs.kernel import claims

    def mapped(shown: Callable[[Any], Any], arcs: Sequence[Any]) -> Iterator[Any]:
        with processes(jobs, needed=len(arcs) > 1) as pool:
            answers = (map if pool is None else pool.map)(shown, arcs)
            yield from watched(answers, "arcs", len(arcs), not common.quiet)

    try:
        result = {"accepted": True, "statement": claims.check(file, mapped)}
    except claims.Unproved as fault:
        result = {"accepted": False, "fails": str(fault)}
        if not common.json:
            raise AccuracyError(f"not proved: {fault}") from None
    except claims.Refused as fault:
        raise InputError(f"no certificate: {fault}") from None
    print_result(common, result)
    return 0 if result["accepted"] else 1


COMMANDS = (certify,)
