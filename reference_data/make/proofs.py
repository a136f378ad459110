"""The proofs of reference values: enclosures, the statement, and the command to repeat it.

Eigenvalues, the Hopf point, and limit cycles and Omega_h under both friction laws have proofs. The
interval of a value must contain its enclosure. If it does not, the value is wrong or claims more
than is proved, and nothing is written.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from tippedisk_verify.errors import AccuracyError
from tippedisk_verify.numbers.measured import Measured
from tippedisk_verify.reference_values.entries import Case, MeasuredValues
from tippedisk_verify.reference_values.truths import connection_numbers

__all__ = ["proved"]

_DIGITS = 52  # two more than most values claim
_OMEGA_H_DIGITS = 104  # so that the enclosures lie inside the intervals of the 100 digits stored
#: The entries near Omega_h that have proofs. Closer to it a proof takes minutes.
_NEAR = ("het+1e-1", "het+1e-2", "het+1e-3", "het+1e-4")


Proof = tuple[str, str, MeasuredValues]  #: statement, command, enclosures


def proved(case: Case, values: MeasuredValues) -> dict[str, Any] | None:
    """Prove an entry's numbers.

    Args:
        case: The entry, with its inputs as decimals.
        values: The numbers.

    Returns:
        The proof as in proofs.json, or None for a kind without proofs.

    Raises:
        AccuracyError: If the attempt ends without a proof, or an interval does not contain its
            enclosure.
    """
    prove = _PROOFS.get(case.entry.kind)
    if prove is None or (
        case.entry.kind == "near-heteroclinic" and case.entry.id.split("/")[3] not in _NEAR
    ):
        return None
    statement, command, enclosures = prove(case, values)
    for name, enclosure in enclosures.items():
        if not values[name].contains(enclosure):
            raise AccuracyError(
                f"{case.entry.id}/{name} does not contain its enclosure: it is wrong, or claims too "
                f"much"
            )
    held = {name: enclosure.to_dict() for name, enclosure in enclosures.items()}
    return {"statement": statement, "command": command, "enclosures": held}


def _equilibrium(case: Case, values: MeasuredValues) -> Proof:
    from tippedisk_verify.proofs.closed_forms import proved_equilibrium

    omega = case.entry.inputs["Omega"]
    proof = proved_equilibrium(case.disk, omega, case.inputs["equilibrium"], _DIGITS)
    parts = (part for value in proof.eigenvalues for part in (value.re, value.im))
    enclosures = {
        f"lambda_{n // 2 + 1}_{('re', 'im')[n % 2]}": part for n, part in enumerate(parts)
    }
    return (proof.statement, _command("equilibria", case, f" --omega {omega}"), enclosures)


def _hopf(case: Case, values: MeasuredValues) -> Proof:
    from tippedisk_verify.proofs.closed_forms import proved_hopf

    proof = proved_hopf(case.disk, _DIGITS)
    numbers = {name: getattr(proof, name, None) for name in values}
    enclosures = {name: number for name, number in numbers.items() if isinstance(number, Measured)}
    return (proof.statement, _command("hopf", case), enclosures)


def _connection(case: Case, values: MeasuredValues) -> Proof:
    from tippedisk_verify.proofs.search.connection_proof import prove_connection

    # Start as the command does: the stored value has too few digits for so short an interval.
    near = case.disk.heteroclinic(digits=_OMEGA_H_DIGITS + 5).omega_h.value
    proof = prove_connection(case.disk, near, _OMEGA_H_DIGITS)
    if not proof.proved or proof.omega_h is None:
        raise AccuracyError(proof.statement)
    command = _command("heteroclinic", case, digits=_OMEGA_H_DIGITS)
    return (proof.statement, command, connection_numbers(proof))


def _cycle(case: Case, values: MeasuredValues) -> Proof:
    from tippedisk_verify.proofs.search.cycle_proof import prove_cycle

    omega = case.entry.inputs["Omega"]
    proof = prove_cycle(
        case.disk, omega, (values["gamma_bar_0"].value, values["v_0"].value), digits=_DIGITS
    )
    if not proof.proved:
        raise AccuracyError(f"{case.entry.id}: {proof.statement}")
    numbers = proof.numbers()
    enclosures = {name: numbers[name] for name in values if name in numbers}
    return (proof.statement, _command("orbit", case, f" --omega {omega}"), enclosures)


def _command(subject: str, case: Case, options: str = "", digits: int = _DIGITS) -> str:
    law = " --friction smooth" if case.disk.friction == "smooth" else ""
    disk = case.entry.id.partition("/")[0]
    return f"tippedisk-verify certify {subject} --parameters {disk}{law}{options} --digits {digits}"


_PROOFS: dict[str, Callable[[Case, MeasuredValues], Proof]] = {
    "equilibrium": _equilibrium,
    "hopf": _hopf,
    "heteroclinic": _connection,
    "limit-cycle": _cycle,
    "near-heteroclinic": _cycle,
}
