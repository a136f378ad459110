"""`certify branch`: the family of limit cycles as one curve; or the paper's cycles, or others, proved one by one."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from fractions import Fraction
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import click

from tippedisk_verify.commands.certify_family import family_as_a_curve
from tippedisk_verify.commands.common import (
    Common,
    certificate_option,
    checked_jobs,
    common_options,
    executor_option,
    print_result,
    processes,
    progress,
)
from tippedisk_verify.errors import InputError

if TYPE_CHECKING:
    from tippedisk_verify.cycles.shooting import LimitCycle
    from tippedisk_verify.model.parameters import Parameters
    from tippedisk_verify.proofs.search.cycle import OrbitProof

__all__ = ["MOST_DIGITS", "branch", "proofs_of"]

MOST_DIGITS = 12  # what the ordinary road's guesses have
_LARGEST = 2**24  # bytes of a file of speeds
_SETS = ("A^in", "A^de", "A^in+A^de")
Told = tuple[dict[str, object], str]
_Job = tuple[tuple[int, Fraction, tuple[Fraction, Fraction]], ...]


@click.command()
@click.option("--at", "where", metavar="FILE|A^in|A^de|A^in+A^de", help="Cycles one by one; one speed [rad/s] a line.")
@click.option(
    "--to", "until", metavar="X", help="As one curve: only to this gamma_bar_0 [rad], without the end at Omega_h."
)
@click.option("--out", metavar="DIR", help="As one curve: write a picture of what is proved there.")
@certificate_option
@executor_option
@click.option("--jobs", type=int, metavar="N", help="Processes; as many as there are cores if not given.")
@common_options
def branch(
    common: Common,
    where: str | None,
    until: str | None,
    out: str | None,
    certificate: Path | None,
    executor: str,
    jobs: int | None,
) -> int:
    """Prove the family of limit cycles from the Hopf point to the heteroclinic cycle: one curve, stable, Omega falls.

    It takes some 6 minutes of CPU. Every worker of a cluster needs this version of the package. With --at the cycles
    at many speeds are proved one by one instead: the period to DIGITS digits, stability, and the rest of `orbit`. A^in
    and A^de are the paper's sets, each with Omega_0 = Omega_crit - 0.5.
    """
    if where is None:
        return family_as_a_curve(common, jobs, until, out, certificate, executor)
    if (until, out, certificate, executor) != (*(None,) * 3, "local"):
        raise InputError("--to, --out, --certificate and --executor belong to the family as one curve: leave out --at")
    if common.digits > MOST_DIGITS:
        raise InputError(f"a branch is proved to at most {MOST_DIGITS} digits, not {common.digits}: ask orbit for more")
    checked_jobs(jobs)
    cycles = _cycles(common.parameters, where)
    proofs = proofs_of(common, cycles, jobs)
    count = sum(bool(entries["proved"]) for entries, _ in proofs)
    decided = sum(entries.get("stable") is not None for entries, _ in proofs)
    result = {"proved": count == len(proofs), "share_proved": count / len(proofs), "cycles": [x for x, _ in proofs]}
    told = [line for _, line in proofs]
    print_result(common, result, [*told, f"{count} of {len(proofs)} cycles proved, {decided} with their stability"])
    return 0 if result["proved"] else 1


def proofs_of(common: Common, cycles: Sequence[LimitCycle], jobs: int | None) -> list[Told]:
    """The proofs of these cycles, in their order, as JSON and as a line."""
    from tippedisk_verify.parallel import as_done, usable_cores

    found: dict[int, Told] = {}
    count = max(1, min(jobs or usable_cores(), len(cycles) // 20))
    with progress(common, len(cycles)) as advance, processes(count) as pool:
        # Each process has cycles from everywhere: those next to Omega_h take longest.
        groups = [tuple(range(first, len(cycles), count)) for first in range(count)]
        states = [(cycle.omega.value, (cycle.gamma_bar_0.value, cycle.v_0.value)) for cycle in cycles]
        work = [tuple((n, *states[n]) for n in group) for group in groups]
        for job, proofs in as_done(partial(_proved, common.parameters, common.digits), work, pool):
            found |= dict(zip((n for n, *_ in job), proofs, strict=True))
            advance("proof", len(proofs))
    return [found[n] for n in range(len(cycles))]


def _proved(parameters: Parameters, digits: int, job: _Job) -> list[Told]:
    from tippedisk_verify.proofs.search.lane_cycles import prove_cycles

    proofs = prove_cycles(parameters, [speed for _, speed, _ in job], [guess for *_, guess in job], digits=digits)
    return [(proof.to_dict(), _line(proof)) for proof in proofs]  # Arb's balls do not travel between processes


def _cycles(parameters: Parameters, where: str) -> list[LimitCycle]:
    """The ordinary road's cycles at these speeds."""
    from tippedisk_verify.atlas.branch import family
    from tippedisk_verify.flow import default_engine

    if where in _SETS:
        cycles = list(family(parameters, default_engine(), paper_sets=True))
        start = cycles[0].omega.value
        return [
            cycle
            for cycle in cycles
            if cycle.omega.value == start or where == _SETS[2] or (cycle.omega.value > start) == (where == _SETS[0])
        ]
    speeds = list(_read(where))
    return list(family(parameters, default_engine(), omegas=speeds))


def _read(name: str) -> Iterator[str]:
    """The file's lines that are not empty."""
    from tippedisk_verify.files import read_text

    try:
        text = read_text(Path(name), _LARGEST)
    except InputError as fault:
        raise InputError(f"--at needs A^in, A^de, A^in+A^de or a file of speeds: {fault}") from None
    yield from filter(None, map(str.strip, text.splitlines()))


def _line(proof: OrbitProof) -> str:
    if not proof.proved:
        return f"omega {float(proof.omega):.12g} rad/s  not proved: {proof.status.value} ({proof.where})"
    numbers = proof.numbers()
    manner = {True: "stable", False: "unstable", None: "stability open"}[proof.stable]
    return (
        f"omega {float(proof.omega):.12g} rad/s  period {numbers['period']} s"
        f"  beta_max {numbers['beta_max']} rad  {manner}"
    )
