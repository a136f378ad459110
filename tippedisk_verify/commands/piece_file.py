"""Proved pieces of the family of limit cycles with their evidence, kept in a file from run to run.

The file is a cache of what this code has proved, and no certificate: nothing in it is checked again but that the
pieces are one curve, unless a certificate is made of them. It belongs to one disk and one version of the code that
proves. Its checksum finds damage; whoever changes a number can make a new checksum.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from tippedisk_verify.cache import read_checked, write_checked
from tippedisk_verify.errors import InputError
from tippedisk_verify.files import output_file
from tippedisk_verify.provenance import code_version

if TYPE_CHECKING:
    from tippedisk_verify.model.parameters import Parameters
    from tippedisk_verify.proofs.kernel.claims.arcs import Piece

__all__ = ["read_pieces", "write_pieces"]

_MOST_BYTES = 64 * 2**20
_PROVES = "of each amplitude: exactly one cycle in the box, stable; Omega falls, the period and beta_max grow with it"


def read_pieces(name: str, parameters: Parameters) -> list[Piece]:
    """The pieces in the file; none if there is no such file.

    Raises InputError for a file that cannot be written again, is damaged, or belongs to another disk or other code.
    """
    from tippedisk_verify.proofs.search.arcs import read_piece

    path = output_file(name)
    if not path.exists():
        return []
    content = read_checked(path, _MOST_BYTES)
    try:
        disk, theirs, entries = content["disk"], content["origin"], content["pieces"]
        pieces = [read_piece(entry, entry["evidence"]) for entry in entries]
    except (KeyError, TypeError, ValueError, AttributeError):
        raise InputError(f"--arcs {path.name}: this is no file of proved arcs, or it is damaged") from None
    if disk != parameters.definition():
        raise InputError(f"--arcs {path.name}: its arcs were proved for another disk: give another file")
    if theirs != code_version():
        raise InputError(f"--arcs {path.name}: its arcs were proved by {str(theirs)[:200]}: give another file")
    return pieces


def write_pieces(name: str, parameters: Parameters, pieces: Sequence[Piece]) -> None:
    """Replace the file by one with these pieces. Raises InputError if it cannot be written."""
    from tippedisk_verify.proofs.search.arcs import piece_entry

    ordered = sorted(pieces, key=lambda piece: piece.low)
    entries = [piece_entry(piece) | {"evidence": piece.evidence} for piece in ordered]
    head = {"disk": parameters.definition(), "origin": code_version(), "proves": _PROVES}
    write_checked(Path(name), head | {"pieces": entries})
