"""The commands of `certify`: numbers with a proof by ball arithmetic, and the check of a certificate.

Exit status 0: proved; 1: not proved, and the status says where the proof stopped; 2: bad input.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from tippedisk_verify.commands.certify_branch import branch
from tippedisk_verify.commands.certify_orbit import orbit
from tippedisk_verify.commands.common import (
    Common,
    certificate_option,
    checked_jobs,
    common_options,
    plain_options,
    print_result,
    processes,
    progress,
    speed,
    speed_options,
)
from tippedisk_verify.errors import InputError, NoConnectionError, Shortfall

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from tippedisk_verify.model.parameters import Parameters
    from tippedisk_verify.proofs.search.connection_end import ProvedEnd
    from tippedisk_verify.proofs.search.proved_connection import ProvedConnection

__all__ = ["COMMANDS"]


@click.group(invoke_without_command=True)
@click.pass_context
def certify(context: click.Context) -> None:
    """Prove numbers: enclosures by ball arithmetic, each with the statement proved."""
    if context.invoked_subcommand is None:
        click.echo(context.get_help())


@certify.command()
@click.option("--every-speed", is_flag=True, help="Prove stability at every speed instead, and Omega_crit.")
@speed_options
@common_options
def equilibria(common: Common, omega: str | None, below_crit: str | None, every_speed: bool) -> int:
    """Prove eigenvalues and stability of inverted and noninverted spinning (both friction laws)."""
    from tippedisk_verify.proofs.closed_forms import proved_equilibrium, proved_stability

    if every_speed:
        if omega is not None or below_crit is not None:
            raise InputError("--every-speed takes the place of --omega and --below-crit")
        print_result(common, {"proved": True, **proved_stability(common.parameters, common.digits).to_dict()})
        return 0
    value = speed(common, omega, below_crit)
    proofs = {name: proved_equilibrium(common.parameters, value, name, common.digits) for name in _EQUILIBRIA}
    print_result(common, {"proved": True, **{name: proof.to_dict() for name, proof in proofs.items()}})
    return 0


@certify.command()
@common_options
def hopf(common: Common) -> int:
    """Prove the Hopf point: where it is, its normal form, and on which side the limit cycles are."""
    from tippedisk_verify.proofs.closed_forms import proved_hopf

    common.parameters.refuse_smooth("the Hopf point's normal form is")
    print_result(common, {"proved": True, **proved_hopf(common.parameters, common.digits).to_dict()})
    return 0


@certify.command()
@click.option("--near", metavar="X", help="Prove it about this speed [rad/s]; about the computed Omega_h if not given.")
@click.option(
    "--cycles",
    metavar="D",
    help="Prove also the limit cycle of every speed up to D [rad/s] above Omega_h (rounded to 4 decimals).",
)
@certificate_option
@common_options
def heteroclinic(common: Common, near: str | None, cycles: str | None, certificate: Path | None) -> int:
    """Prove Omega_h in an interval no longer than 10^-DIGITS, and that it is the only one there."""
    from tippedisk_verify.files import write_text
    from tippedisk_verify.proofs.search.heteroclinic import MOST_DIGITS

    if cycles is not None:
        from tippedisk_verify.proofs.search.connection_end import checked_distance

        checked_distance(cycles)
        common.parameters.refuse_smooth("limit cycles next to the connection are proved")
    if common.digits > MOST_DIGITS:
        raise InputError(f"a proof of Omega_h is offered to {MOST_DIGITS} digits, not {common.digits}")
    proof = _connection(common, common.parameters, common.digits, near)
    result, proved = proof.to_dict(), proof.proved
    shown: ProvedConnection | ProvedEnd = proof
    if cycles is not None:
        shown = _end(common, proof, cycles)
        result, proved = result | {"cycles": shown.to_dict()}, shown.proved
    if proved and certificate is not None:
        write_text(certificate, shown.certificate())
    print_result(common, result)
    return 0 if proved else 1


@certify.command()
@click.argument("file")
@click.option("--jobs", type=int, metavar="N", help="Processes, for a family's arcs; as many as cores if not given.")
@plain_options
def check(common: Common, file: str, jobs: int | None) -> int:
    """Replay a certificate: its choices are tested again, without the search that found them.

    A family of limit cycles takes some four minutes of CPU, all else less than one.
    """
    from tippedisk_verify.progress import watched
    from tippedisk_verify.proofs.kernel import claims

    checked_jobs(jobs)

    def mapped(shown: Callable[[Any], Any], arcs: Sequence[Any]) -> Iterator[Any]:
        with processes(jobs, needed=len(arcs) > 1) as pool:
            done = (map if pool is None else pool.map)(shown, arcs)
            yield from watched(done, "arcs", len(arcs), not common.quiet)

    try:
        result = {"accepted": True, "statement": claims.check(file, mapped)}
    except claims.Unproved as fault:
        result = {"accepted": False, "fails": str(fault)}
        if not common.json:
            raise Shortfall(f"not proved: {fault}") from None
    except claims.Refused as fault:
        raise InputError(f"no certificate: {fault}") from None
    print_result(common, result)
    return 0 if result["accepted"] else 1


def _connection(common: Common, parameters: Parameters, digits: int, near: str | None) -> ProvedConnection:
    """The proof about a speed given, or about the Omega_h that the ordinary road finds."""
    from tippedisk_verify.proofs.search.heteroclinic import prove_connection
    from tippedisk_verify.proofs.search.proved_connection import Status, not_proved

    with progress(common, 2) as advance:
        try:
            if near is None:
                from tippedisk_verify.connection.heteroclinic import heteroclinic as connection
                from tippedisk_verify.flow import default_engine

                advance("an approximation", 0)
                guess: object = connection(parameters, default_engine(), digits=digits + 5).omega_h.value
            else:
                guess = near
            advance("proof", 1)
            proof = prove_connection(parameters, guess, digits)
        except NoConnectionError as fault:
            proof = not_proved(Status.NO_SADDLE, detail=str(fault))
        advance("proof", 1)
    return proof


def _end(common: Common, connection: ProvedConnection, reach: object) -> ProvedEnd:
    """The proof of the limit cycles next to a connection."""
    from tippedisk_verify.proofs.search.connection_end import prove_end

    with progress(common, 100) as advance:
        done = 0

        def watch(share: float) -> None:
            nonlocal done
            advance("limit cycles", int(100 * share) - done)
            done = int(100 * share)

        return prove_end(connection, reach, watch=watch)


_EQUILIBRIA = ("inverted", "noninverted")
certify.add_command(orbit)
certify.add_command(branch)
COMMANDS = (certify,)
