"""The commands `certify equilibria|hopf|orbit|heteroclinic|branch|check`: proofs and their check.

The exit status is 0 if the statement is proved, 1 if the proof stopped (the status names the
place), and 2 for bad input.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from tippedisk_verify.commands.definition import (
    DiskOptions,
    OutputOptions,
    command,
    disk_command,
    group,
)
from tippedisk_verify.commands.jobs import jobs_option, process_pool
from tippedisk_verify.commands.options import (
    below_crit_option,
    certificate_option,
    decimal_callback,
    lock_output_folder,
    omega_option,
    unstable_option,
)
from tippedisk_verify.display import result_lines
from tippedisk_verify.errors import AccuracyError, InputError
from tippedisk_verify.support.files import printable, write_text
from tippedisk_verify.support.parallel import map_of
from tippedisk_verify.support.progress import with_progress

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

__all__ = ["COMMANDS"]


@disk_command(
    "Prove eigenvalues and stability of inverted and noninverted spinning (both friction laws)."
)
@click.option(
    "--every-speed", is_flag=True, help="Prove stability at every speed instead, and Omega_crit."
)
@omega_option
@below_crit_option
def equilibria(
    common: DiskOptions, every_speed: bool, omega: str | None, below_crit: str | None
) -> dict[str, Any]:
    prover, digits = common.disk.certify, common.digits
    if every_speed:
        if omega is not None or below_crit is not None:
            raise InputError("--every-speed takes the place of --omega and --below-crit")
        return {"proved": True, **prover.stability(digits=digits).to_dict()}
    speed = common.speed(omega, below_crit)
    names = ("inverted", "noninverted")
    return {
        "proved": True,
        **{name: prover.equilibrium(name, speed, digits=digits).to_dict() for name in names},
    }


@disk_command(
    "Prove the Hopf point: where it is, its normal form, and on which side the limit cycles are."
)
def hopf(common: DiskOptions) -> dict[str, Any]:
    return {"proved": True, **common.disk.certify.hopf(digits=common.digits).to_dict()}


@disk_command("Prove one limit cycle: existence, uniqueness nearby, its numbers, its stability.")
@click.option(
    "--guess",
    nargs=2,
    metavar="GAMMA_BAR V",
    help="Start from this state [rad, rad/s] at beta = pi/2;"
    " for a rotating cycle, from beta_bar and v at gamma = pi/2.",
)
@click.option(
    "--rotating", is_flag=True, help="Prove the cycle on which gamma grows by 2 pi in each period."
)
@unstable_option
@click.option(
    "--at-fold",
    is_flag=True,
    help="Prove a fold of the family, where two of its cycles meet and end.",
)
@click.option("--fold", type=int, metavar="N", help="The fold's number, if there are several.")
@certificate_option
@omega_option
@below_crit_option
def orbit(
    common: DiskOptions,
    guess: tuple[str, str] | None,
    rotating: bool,
    unstable: bool,
    at_fold: bool,
    fold: int | None,
    certificate: Path | None,
    omega: str | None,
    below_crit: str | None,
) -> Any:
    prover, digits = common.disk.certify, common.digits
    if fold is not None and not at_fold:
        raise InputError("--fold belongs to --at-fold")
    if at_fold:
        if omega is not None or below_crit is not None or guess is not None or unstable:
            raise InputError("--at-fold finds the speed itself: leave out the other options")
        return _write_certificate(prover.fold(fold, rotating=rotating, digits=digits), certificate)
    speed, options = (
        common.speed(omega, below_crit),
        {"stable": False if unstable else None, "guess": guess},
    )
    return _write_certificate(
        prover.limit_cycle(speed, rotating=rotating, digits=digits, **options), certificate
    )


@disk_command(
    "Prove Omega_h in an interval no longer than 10^-DIGITS, and that it is the only one there."
)
@click.option(
    "--near",
    callback=decimal_callback,
    metavar="X",
    help="Look near this speed [rad/s]; if not given, near the computed Omega_h.",
)
@click.option(
    "--cycles",
    callback=decimal_callback,
    metavar="D",
    help="Also prove the limit cycle of every speed up to D [rad/s] above Omega_h (rounded to 4 "
    "decimals).",
)
@certificate_option
def heteroclinic(
    common: DiskOptions, near: str | None, cycles: str | None, certificate: Path | None
) -> Any:
    prover, options = common.disk.certify, {"digits": common.digits, "progress": not common.quiet}
    if cycles is None:
        return _write_certificate(prover.heteroclinic(near, **options), certificate)
    cycles_proof = _write_certificate(prover.near_omega_h(cycles, near, **options), certificate)
    common.show(cycles_proof.connection.to_dict() | {"cycles": cycles_proof.to_dict()})
    return 0 if cycles_proof.proved else 1


def _write_certificate(proof: Any, certificate: Path | None) -> Any:
    """Write the certificate of a proof if a file for it is given and the proof succeeded. Return
    the proof.
    """
    if proof.proved and certificate is not None:
        write_text(certificate, proof.certificate())
    return proof


@disk_command(
    """Prove the family of limit cycles from the Hopf point to the heteroclinic cycle.

    The family is proved to be one curve of stable cycles, on which Omega falls.

    This takes about 6 minutes of CPU.
    """
)
@click.option(
    "--to",
    callback=decimal_callback,
    metavar="X",
    help="Stop at this gamma_bar_0 [rad], and leave out the end at Omega_h.",
)
@click.option("--out", metavar="DIR", help="Write a picture of the proved family there.")
@certificate_option
@jobs_option
def branch(
    common: DiskOptions, to: str | None, out: str | None, certificate: Path | None, jobs: int | None
) -> int:

    def workers(several: bool) -> Any:
        return process_pool(jobs, needed=several)

    folder = lock_output_folder(out)
    proof = common.disk.certify.branch(to, workers=workers, progress=not common.quiet)
    if certificate is not None and proof.hopf_closed:
        write_text(certificate, proof.certificate())
    if folder is not None and proof.hopf_closed:
        from tippedisk_verify.figures.proved_family_figure import draw_proved_family
        from tippedisk_verify.figures.style import save

        save(draw_proved_family(proof), folder, "proved_family")
    entries = proof.to_dict()
    shown = {name: len(proof.arcs) if name == "arcs" else entry for name, entry in entries.items()}
    common.show(entries, result_lines(shown))
    return 0 if proof.proved else 1


@command(
    """Replay a certificate: test its choices again, without the search that found them.

    A family of limit cycles takes about four minutes of CPU, everything else less than one.
    """
)
@click.argument("file")
@jobs_option
def check(output: OutputOptions, file: str, jobs: int | None) -> int:
    from tippedisk_verify.proofs.kernel import certificates

    def map_arcs(shown: Callable[[Any], Any], arcs: Sequence[Any]) -> Iterator[Any]:
        with process_pool(jobs, needed=len(arcs) > 1) as pool:
            answers = map_of(pool)(shown, arcs)
            yield from with_progress(answers, "arcs", len(arcs), not output.quiet)

    try:
        output.show({"accepted": True, "statement": certificates.check(file, map_arcs)})
        return 0
    except certificates.Unproved as fault:
        if not output.json:
            raise AccuracyError(f"not proved: {fault}") from None
        output.show({"accepted": False, "fails": str(fault)})
        return 1
    except certificates.NotACertificate as fault:
        raise InputError(f"{printable(file)} is not a certificate: {fault}") from None


_HELP = "Prove numbers: enclosures by ball arithmetic, each with the statement proved."
COMMANDS = (group("certify", _HELP, equilibria, hopf, orbit, heteroclinic, branch, check),)
