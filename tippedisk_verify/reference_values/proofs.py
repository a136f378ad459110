"""The grade *proved*: reference values held by enclosures in ball arithmetic, with the statement and how to prove it.

Eigenvalues, the Hopf point, and, under both friction laws, limit cycles and Omega_h. An entry gains ``proof``, the
statement and the command that proves it again; each of its quantities ``enclosure``, and the grade. The value's
half-width must contain the enclosure. If it does not, the value is wrong or claims more than is proved, and nothing is
written.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tippedisk_verify.errors import InputError, Shortfall
from tippedisk_verify.files import sole_writer
from tippedisk_verify.model.measured import Measured
from tippedisk_verify.model.parameters import Parameters
from tippedisk_verify.parallel import as_done
from tippedisk_verify.reference_values.entries import as_measured
from tippedisk_verify.reference_values.generation import file_text
from tippedisk_verify.reference_values.kinds import KINDS, kind_named
from tippedisk_verify.reference_values.manifest import replace_files, sound_files
from tippedisk_verify.reference_values.tables import tables

__all__ = ["Proof", "prove", "proved_entry"]

_DIGITS = 52  # two more than most values claim
_OMEGA_H_DIGITS = 104  # so that the enclosures lie within the half-widths of the 100 digits stored
#: Closer to Omega_h a proof takes minutes.
_NEAR = ("het+1e-1", "het+1e-2", "het+1e-3", "het+1e-4")
_CYCLE = (
    *("period", "gamma_bar_0", "v_0", "beta_max", "multiplier_slow", "log_multiplier_slow", "log_multiplier_fast"),
    *("dperiod_domega", "dgamma_bar_0_domega", "dv_0_domega"),
)


@dataclass(frozen=True)
class Proof:
    """What is proved of one entry."""

    statement: str
    command: str
    enclosures: dict[str, Measured]


def _provable(id_: str) -> bool:
    _, _, kind, place = id_.split("/")
    return kind in ("equilibrium", "hopf", "limit-cycle", "heteroclinic") or (
        kind == "near-heteroclinic" and place in _NEAR
    )


def proved_entry(entry: dict[str, Any]) -> Proof:
    """The proof of one entry of a reference file.

    Raises Shortfall if the attempt ends without one, InputError for a kind that has none.
    """
    if not _provable(entry["id"]):
        raise InputError(f"no proof is offered for {entry['id']}")
    set_name, friction, kind, _ = entry["id"].split("/")
    parameters = Parameters.named(set_name).with_friction("smooth" if friction == "smooth" else "linear")
    if kind == "equilibrium":
        return _equilibrium(parameters, entry["inputs"])
    if kind == "hopf":
        return _hopf(parameters, tuple(entry["quantities"]))
    if kind == "heteroclinic":
        return _connection(parameters)
    return _cycle(parameters, entry)


def _equilibrium(parameters: Parameters, inputs: dict[str, str]) -> Proof:
    from tippedisk_verify.proofs.closed_forms import proved_equilibrium

    proved = proved_equilibrium(parameters, inputs["Omega"], inputs["equilibrium"], _DIGITS)
    enclosures = {}
    for place, value in enumerate(proved.eigenvalues, start=1):
        enclosures[f"lambda_{place}_re"], enclosures[f"lambda_{place}_im"] = value.re, value.im
    command = f"certify equilibria --parameters {parameters.name} --omega {inputs['Omega']} --digits {_DIGITS}"
    return Proof(proved.statement, command, enclosures)


def _hopf(parameters: Parameters, names: Sequence[str]) -> Proof:
    from tippedisk_verify.proofs.closed_forms import proved_hopf

    proved = proved_hopf(parameters, _DIGITS)
    enclosures = {name: getattr(proved, name) for name in names if isinstance(getattr(proved, name, None), Measured)}
    return Proof(proved.statement, f"certify hopf --parameters {parameters.name} --digits {_DIGITS}", enclosures)


def _connection(parameters: Parameters) -> Proof:
    from tippedisk_verify.connection.heteroclinic import heteroclinic
    from tippedisk_verify.flow import default_engine
    from tippedisk_verify.proofs.search.heteroclinic import prove_connection

    # As the command does it: the stored value has too few digits for so short an interval.
    near = heteroclinic(parameters, default_engine(), digits=_OMEGA_H_DIGITS + 5).omega_h.value
    proof = prove_connection(parameters, near, _OMEGA_H_DIGITS)
    if not proof.proved or proof.omega_h is None:
        raise Shortfall(proof.statement)
    names = ("lambda_u", "lambda_s", "lambda_ss")
    enclosures = {"omega_h": proof.omega_h, **dict(zip(names, proof.saddle_eigenvalues, strict=True))}
    command = f"certify heteroclinic {_disk(parameters)} --digits {_OMEGA_H_DIGITS}"
    return Proof(proof.statement, command, enclosures)


def _cycle(parameters: Parameters, entry: dict[str, Any]) -> Proof:
    from tippedisk_verify.proofs.search.cycle import prove_cycle

    omega, told = entry["inputs"]["Omega"], entry["quantities"]
    guess = (told["gamma_bar_0"]["value"], told["v_0"]["value"])
    proof = prove_cycle(parameters, omega, guess, digits=_DIGITS)
    if not proof.proved:
        raise Shortfall(f"{entry['id']}: {proof.statement}")
    numbers = proof.numbers()
    command = f"certify orbit {_disk(parameters)} --omega {omega} --digits {_DIGITS}"
    return Proof(proof.statement, command, {name: numbers[name] for name in _CYCLE if name in numbers})


def _disk(parameters: Parameters) -> str:
    """The options that name the disk and its friction law."""
    return f"--parameters {parameters.name}" + " --friction smooth" * (parameters.friction == "smooth")


def _with_proof(entry: dict[str, Any], proof: Proof) -> dict[str, Any]:
    """The entry with its proof. Raises Shortfall if a value's half-width does not contain the enclosure."""
    quantities = {}
    for name, quantity in entry["quantities"].items():
        enclosure = proof.enclosures.get(name)
        if enclosure is None:
            quantities[name] = quantity
            continue
        told = enclosure.to_dict()
        if not as_measured(quantity).contains(as_measured(told)):
            raise Shortfall(f"{entry['id']}/{name} does not contain its enclosure: it is wrong, or claims too much")
        quantities[name] = {**quantity, "grade": "proved", "enclosure": told}
    source = {"statement": proof.statement, "command": f"tippedisk-verify {proof.command}"}
    return {**entry, "proof": source, "quantities": quantities}


def prove(
    folder: Path,
    *,
    prefixes: Sequence[str] = (),
    executor: Executor | None = None,
    advance: Callable[[str, int], None] = lambda label, steps: None,
) -> int:
    """Prove what can be proved of a folder's entries (those whose id starts so), and write it; how many were.

    Raises InputError if the folder cannot be used or nothing in it can be proved, Shortfall if a proof fails.
    """
    with sole_writer(folder):
        return _prove(folder, prefixes, executor, advance)


def _prove(
    folder: Path, prefixes: Sequence[str], executor: Executor | None, advance: Callable[[str, int], None]
) -> int:
    documents = {}
    for name, text in sound_files(folder).items():
        try:
            document = json.loads(text)
            documents[name] = document, [entry["id"] for entry in document["entries"]]
        except (ValueError, KeyError, TypeError, RecursionError):
            raise InputError(f"reference file {folder / name} cannot be read: run reference check") from None
    wanted = {
        id_: entry
        for document, ids in documents.values()
        for id_, entry in zip(ids, document["entries"], strict=True)
        if _provable(id_) and (not prefixes or id_.startswith(tuple(prefixes)))
    }
    if not wanted:
        raise InputError("nothing there can be proved: equilibria, hopf, limit cycles and Omega_h")
    proofs = _proofs(wanted, executor, advance)
    changed = {id_: _with_proof(wanted[id_], proof) for id_, proof in proofs.items()}
    _write(folder, {name: document for name, (document, _) in documents.items()}, changed)
    return len(changed)


def _proofs(
    wanted: dict[str, dict[str, Any]], executor: Executor | None, advance: Callable[[str, int], None]
) -> dict[str, Proof]:
    proofs = {}
    # Omega_h takes longest.
    order = sorted(wanted.values(), key=lambda entry: "/heteroclinic/" not in entry["id"])
    for entry, proof in as_done(proved_entry, order, executor):
        proofs[entry["id"]] = proof
        advance(entry["id"], 1)
    return proofs


def _write(folder: Path, documents: dict[str, dict[str, Any]], changed: dict[str, dict[str, Any]]) -> None:
    texts = {}
    for name, document in documents.items():
        entries = [changed.get(entry["id"], entry) for entry in document["entries"]]
        if entries != document["entries"]:
            document["entries"] = entries
            texts[name] = file_text(kind_named(document["kind"]), document["set"], entries)
    rank = {kind.name: place for place, kind in enumerate(KINDS)}
    for set_folder in sorted({name.partition("/")[0] for name in documents}):
        present = [document for name, document in documents.items() if name.startswith(f"{set_folder}/")]
        present.sort(key=lambda document: rank[document["kind"]])
        texts |= {f"{set_folder}/{name}": text for name, text in tables(present).items()}
    replace_files(folder, texts)
