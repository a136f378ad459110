"""`certify branch` without --at: the family of limit cycles from the Hopf point on, proved as one curve."""

from __future__ import annotations

from collections.abc import Iterator
from fractions import Fraction
from functools import partial
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
    from tippedisk_verify.proofs.kernel.claims.arcs import Piece, Status
    from tippedisk_verify.proofs.search.branch import BranchProof
    from tippedisk_verify.proofs.search.family import Interval, Known

__all__ = ["family_as_a_curve"]

_UNITS = 1000  # of the bar, for each rad
_FURTHEST = Fraction("3.1415")  # rad


def family_as_a_curve(
    common: Common,
    jobs: int | None,
    until: str | None,
    out: str | None,
    certificate: Path | None,
    executor: str,
) -> int:
    """Prove as much of the family as can be, and say how much that is."""
    from tippedisk_verify.proofs.kernel.claims.arcs import Piece
    from tippedisk_verify.proofs.search.family import prove_family

    parameters = common.parameters
    parameters.refuse_smooth("the family of limit cycles is proved as one curve")
    wanted = None if until is None else _amplitude(until)
    checked_jobs(jobs)
    folder = alone_in(out)
    count = 0
    with workers_of(executor, jobs, needed=False):
        pass  # a cluster that is not there is told at once
    with progress(common, int(_UNITS * (wanted or _FURTHEST))) as advance:

        def keep(found: Piece | Status, interval: Interval) -> None:
            nonlocal count
            if isinstance(found, Piece):
                count += 1
                advance(f"arcs: {count}", int(_UNITS * interval.high) - int(_UNITS * interval.low))

        advance("arcs", 0)
        proof = prove_family(
            parameters,
            partial(_connected_at, parameters),
            partial(_cycles_at, parameters),
            wanted,
            lambda several: workers_of(executor, jobs, needed=several),
            lambda stage: advance(stage, 0),
            keep,
        )
    if certificate is not None and proof.hopf_closed:
        write_text(certificate, proof.certificate())
    if folder is not None and proof.hopf_closed:
        from tippedisk_verify.figures.proved_family import draw_proved_family
        from tippedisk_verify.figures.style import save

        save(draw_proved_family(proof), folder, "proved_family")
    print_result(common, proof.to_dict(), _lines(proof))
    return 0 if proof.proved else 1


def _connected_at(parameters: Parameters, digits: int) -> Fraction | None:
    """Omega_h [rad/s]; None where none is found."""
    from tippedisk_verify.connection.heteroclinic import heteroclinic
    from tippedisk_verify.flow import default_engine

    try:
        return heteroclinic(parameters, default_engine(), digits=digits).omega_h.value
    except (NoConnectionError, Shortfall):
        return None


def _cycles_at(parameters: Parameters, speeds: list[Fraction] | None) -> list[Known]:
    """Cycles from the Hopf point to the connection."""
    from tippedisk_verify.atlas.branch import family
    from tippedisk_verify.flow import default_engine

    try:
        cycles = list(family(parameters, default_engine(), omegas=speeds))
    except NoSuchCycleError as fault:
        raise Shortfall(str(fault)) from None
    return [(cycle.gamma_bar_0.value, cycle.v_0.value, cycle.omega.value, cycle.period.value / 2) for cycle in cycles]


def _amplitude(text: str) -> Fraction:
    from tippedisk_verify.model.exact import exact

    number = exact(text)
    if number.pi_multiple or not 0 < number.rational < _FURTHEST:
        raise InputError(f"--to must be a decimal between 0 and {float(_FURTHEST)} rad, not {text[:40]}")
    return number.rational


def _lines(proof: BranchProof) -> Iterator[str]:
    entries = proof.to_dict()
    del entries["arcs"]
    yield from result_lines(entries)
    yield f"{len(proof.pieces)} arcs"
