"""`certify branch` without --at: the family of limit cycles from the Hopf point on, proved as one curve."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING

from tippedisk_verify.commands.common import (
    Common,
    alone_in,
    checked_jobs,
    print_result,
    progress,
    workers_of,
)
from tippedisk_verify.errors import InputError, NoConnectionError, NoSuchCycleError, Shortfall
from tippedisk_verify.files import write_text
from tippedisk_verify.model.results import result_lines

if TYPE_CHECKING:
    from tippedisk_verify.model.parameters import Parameters
    from tippedisk_verify.proofs.search.branch import BranchProof
    from tippedisk_verify.proofs.search.cover import Interval, Known
    from tippedisk_verify.proofs.search.pieces import Piece, Status
    from tippedisk_verify.proofs.search.proved_connection import ProvedConnection
    from tippedisk_verify.proofs.search.proved_end import ProvedEnd

__all__ = ["family_as_a_curve"]

_DEFAULT_END = "3.06"  # rad: beyond it pieces become short
_REACHES = ("0.008", "0.004", "0.002")  # rad/s above Omega_h: how far cycles next to the connection are tried
_OVERLAP = Fraction(3, 4)  # of that reach, for the pieces' end
_UNITS = 1000  # of the bar, for each rad
_KNOWN, _NEARER = 60, Fraction(4, 5)  # known cycles; how much nearer to Omega_h each of the last ones is
_NEAREST = Fraction(1, 10**6)  # rad/s from Omega_h
_CONNECTION_DIGITS = 10


def family_as_a_curve(
    common: Common,
    jobs: int | None,
    arcs: str | None,
    until: str | None,
    out: str | None,
    certificate: Path | None,
    executor: str,
) -> int:
    """Prove as much of the family as can be, and say how much that is."""
    from tippedisk_verify.commands.piece_file import read_pieces, write_pieces
    from tippedisk_verify.proofs.search.branch import BranchProof
    from tippedisk_verify.proofs.search.cover import HOPF_END, chain, open_intervals, prove_intervals
    from tippedisk_verify.proofs.search.pieces import Piece, Status

    parameters = common.parameters
    parameters.refuse_smooth("the family of limit cycles is proved as one curve")
    wanted = _amplitude(_DEFAULT_END if until is None else until)
    checked_jobs(jobs)
    folder = alone_in(out)
    pieces = [] if arcs is None else read_pieces(arcs, parameters)
    read = set(pieces)
    with workers_of(executor, jobs, needed=False):
        pass  # a cluster that is not there is told at once
    stopped = None
    connection: ProvedConnection | None = None
    near: ProvedEnd | None = None
    with progress(common, int(_UNITS * wanted)) as advance:

        def keep(found: Piece | Status, interval: Interval) -> None:
            if isinstance(found, Piece):
                pieces.append(found)
                if arcs is not None:
                    write_pieces(arcs, parameters, pieces)
                advance(f"arcs: {len(pieces)}", int(_UNITS * interval.high) - int(_UNITS * interval.low))

        advance("arcs", sum(int(_UNITS * piece.high) - int(_UNITS * piece.low) for piece in pieces))
        # Without the piece at the Hopf point the others are of no use.
        if not chain(pieces):
            advance("the Hopf point", 0)
            first = open_intervals(pieces, min(wanted, HOPF_END))
            stopped = prove_intervals(parameters, first, [], watch=keep)
        if chain(pieces):
            advance("the connection", 0)
            connection = _connection(parameters)
            known = _known(parameters, connection)
            if until is None and connection is not None:
                advance("the cycles next to the connection", 0)
                near = _next_to(connection)
                wanted = _end_for(near, known) or wanted
            if stopped is None and (left := open_intervals(pieces, wanted)):
                with workers_of(executor, jobs, needed=len(left) > 1) as pool:
                    stopped = prove_intervals(parameters, left, known, pool, keep)
    found = chain(pieces)
    if stopped is None and found[-1].high < wanted:
        stopped = Status.NOT_JOINED
    proof = BranchProof(parameters, tuple(found), stopped, connection, near, len(read.intersection(found)))
    if certificate is not None and proof.hopf_closed:
        _certify(common, proof, certificate, executor, jobs)
        proof = replace(proof, read=0)  # the checker has proved every arc, also those that were read
    if folder is not None and proof.hopf_closed:
        from tippedisk_verify.figures.proved_family import draw_proved_family
        from tippedisk_verify.figures.style import save

        save(draw_proved_family(proof), folder, "proved_family")
    print_result(common, proof.to_dict(), _lines(proof))
    return 0 if proof.proved else 1


def _certify(common: Common, proof: BranchProof, path: Path, executor: str, jobs: int | None) -> None:
    """Write the certificate of the arcs."""
    from tippedisk_verify.proofs.search.family_certificate import family_certificate

    with (
        progress(common, len(proof.pieces)) as advance,
        workers_of(executor, jobs, needed=len(proof.pieces) > 1) as pool,
    ):
        advance("certificate", 0)
        text = family_certificate(proof, pool, lambda done: advance(f"certificate: arc {done}", 1))
    write_text(path, text)


def _next_to(connection: ProvedConnection) -> ProvedEnd | None:
    """The cycles next to the connection, as far from it as they can be proved; the last failure if they cannot."""
    from tippedisk_verify.proofs.search.connection_end import prove_end

    end = None
    for reach in _REACHES if connection.proved else ():
        with suppress(InputError):  # of a reach beyond Omega_crit
            end = prove_end(connection, reach)
        if end is not None and end.proved:
            break
    return end


def _end_for(near: ProvedEnd | None, known: list[Known]) -> Fraction | None:
    """An amplitude up to which pieces have to be proved if they are to reach the cycles next to the connection."""
    if near is None or not near.proved or near.connection.omega_h is None:
        return None
    low = near.connection.omega_h.value
    inside = [cycle for cycle in known if cycle[2] - low < _OVERLAP * (near.high - low)]
    return round(min(inside, default=known[-1])[0], 4)


def _amplitude(text: str) -> Fraction:
    from tippedisk_verify.model.exact import exact

    number = exact(text)
    if number.pi_multiple or not 0 < number.rational < Fraction("3.1415"):
        raise InputError(f"--to must be a decimal between 0 and 3.1415 rad, not {text[:40]}")
    return number.rational


def _connection(parameters: Parameters) -> ProvedConnection | None:
    """Omega_h, proved; None where the ordinary road finds none."""
    from tippedisk_verify.connection.heteroclinic import heteroclinic
    from tippedisk_verify.flow import default_engine
    from tippedisk_verify.proofs.search.heteroclinic import prove_connection

    try:
        near = heteroclinic(parameters, default_engine(), digits=_CONNECTION_DIGITS + 5).omega_h.value
        return prove_connection(parameters, near, _CONNECTION_DIGITS)
    except (NoConnectionError, Shortfall):
        return None


def _known(parameters: Parameters, connection: ProvedConnection | None) -> list[Known]:
    """Cycles of the ordinary road from the Hopf point to the connection, to make guesses of."""
    from tippedisk_verify.atlas.branch import family
    from tippedisk_verify.flow import default_engine

    speeds: list[Fraction] | None = None
    if connection is not None and connection.omega_h is not None:
        speeds = [round(speed, 12) for speed in _speeds(parameters, connection.omega_h.value)]
    try:
        cycles = list(family(parameters, default_engine(), omegas=speeds))
    except NoSuchCycleError as fault:
        raise Shortfall(str(fault)) from None
    return [(found.gamma_bar_0.value, found.v_0.value, found.omega.value, found.period.value / 2) for found in cycles]


def _speeds(parameters: Parameters, omega_h: Fraction) -> Iterator[Fraction]:
    """Speeds whose amplitudes lie close together at both ends."""
    from tippedisk_verify.proofs.search.branch import omega_crit

    span = omega_crit(parameters).value - omega_h
    for k in range(_KNOWN // 10, _KNOWN - 1):
        left = span * (1 - Fraction(k, _KNOWN) ** 2)
        yield omega_h + left
    while left > _NEAREST:
        left *= _NEARER
        yield omega_h + left


def _lines(proof: BranchProof) -> Iterator[str]:
    entries = proof.to_dict()
    del entries["arcs"]
    yield from result_lines(entries)
    yield f"{len(proof.pieces)} arcs"
