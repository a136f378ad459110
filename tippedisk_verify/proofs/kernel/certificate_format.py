"""The parts of a certificate and their reading: JSON objects of fixed shapes, with exact numbers as
texts."""

from __future__ import annotations

import hashlib
import json
import os
import re
from collections.abc import Callable, Mapping, Sequence
from fractions import Fraction
from typing import Any, NamedTuple, NoReturn

from flint import arb

from tippedisk_verify.proofs.kernel.balls import (
    Unproved,
    ball,
    require,
    working_bits,
    working_precision,
)
from tippedisk_verify.proofs.kernel.vector_field import PARAMETER_UNITS

__all__ = [
    "DISK_SHAPE",
    "FRICTION_LAWS",
    "NUMBER_SHAPE",
    "STABILITY_WORDS",
    "ClaimReader",
    "NotACertificate",
    "digest",
    "dyadic_text",
    "nearby_double",
    "one_of",
    "read_count",
    "read_decimal",
    "read_dyadic",
    "read_json",
    "read_order",
    "read_precision",
    "read_radius",
    "read_shape",
    "require_claimed_enclosure",
]

# Bytes of a file; the largest whole number; the highest order of a series
_MAX_FILE, _MAX_COUNT, _HIGHEST_ORDER = 2**26, 20_000, 1000
_MIN_BITS = 24


class NotACertificate(Exception):
    """Raised if a file is not a certificate; the message names the fault and its place."""


def read_dyadic(value: Any) -> Any:
    """Read an exact number, a text with a hexadecimal mantissa and a power of two, as one of Arb's
    balls.

    Raises ValueError for any other value.
    """
    match = (
        re.fullmatch(r"(-?[0-9a-f]{1,6000})p(-?[0-9]{1,6})", value, re.ASCII)
        if isinstance(value, str)
        else None
    )
    if not match:
        raise ValueError("a dyadic number as text is needed, such as 1a3p-12")
    return arb((int(match[1], 16), int(match[2])))


def dyadic_text(point: Any) -> str:
    """Write an exact ball or a float as text: a hexadecimal mantissa and a power of two, as
    `read_dyadic` reads it.
    """
    mantissa, exponent = arb(point).man_exp()
    return f"{int(mantissa):x}p{int(exponent)}"


def read_radius(value: Any) -> Any:
    """Read a radius, an exact number as text, and return the ball about zero with this radius.

    Raises ValueError if it is negative.
    """
    size = read_dyadic(value)
    if not size >= 0:
        raise ValueError("a radius must not be negative")
    return arb(0, size)


def read_decimal(value: Any) -> str:
    """Check that a value is the text of an exact decimal or of a ratio of two integers, and return
    it unchanged.

    Raises ValueError for any other value.
    """
    pattern = r"-?[0-9]{1,4000}(\.[0-9]{1,4000}(?!/))?(e-?[0-9]{1,4}(?!/))?(/0{0,3999}[1-9][0-9]{0,3999})?"
    if not isinstance(value, str) or not re.fullmatch(pattern, value, re.ASCII):
        raise ValueError("an exact decimal as text is needed")
    return value


def nearby_double(text: str) -> float:
    """Convert the text of an exact decimal or ratio to a nearby double. Raises Unproved if it is
    out of range.
    """
    try:
        return float(Fraction(text))
    except OverflowError:
        raise Unproved("a choice is beyond any double") from None


def read_count(value: Any) -> int:
    if type(value) is not int or not 1 <= value <= _MAX_COUNT:
        raise ValueError(f"a whole number from 1 to {_MAX_COUNT} is needed")
    return value


def read_precision(value: Any) -> int:
    if read_count(value) < _MIN_BITS:
        raise ValueError(f"at least {_MIN_BITS} bits are needed")
    return int(value)


def read_order(value: Any) -> int:
    if read_count(value) > _HIGHEST_ORDER:
        raise ValueError(f"an order of {_HIGHEST_ORDER} at most is needed")
    return int(value)


def one_of(*alternatives: Any) -> Callable[[Any], Any]:
    def read(value: Any) -> Any:
        if not any(
            value is alternative or (isinstance(value, str) and value == alternative)
            for alternative in alternatives
        ):
            raise ValueError(f"one of {', '.join(map(str, alternatives))} is needed")
        return value

    return read


def read_shape(value: Any, shape: Any, path: str) -> Any:
    """Check that a JSON value has a given shape, and return it with its leaves read.

    Raises NotACertificate, with ``path`` and the fault's place below it, if its shape differs.

    A shape is a dictionary of members (those with '?' are optional), a list [shape, length or
    None], or a function that reads a leaf.
    """
    if isinstance(shape, dict):
        names = {name.removesuffix("?"): part for name, part in shape.items()}
        needed = {name for name in shape if not name.endswith("?")}
        if not isinstance(value, dict) or not needed <= value.keys() <= names.keys():
            raise NotACertificate(
                f"{path}: an object with exactly the members {', '.join(shape)} is needed"
            )
        return {
            name: read_shape(part, names[name], f"{path} {name}") for name, part in value.items()
        }
    if isinstance(shape, list):
        if not isinstance(value, list) or shape[1] not in (len(value), None):
            length = f" of {shape[1]}" if shape[1] else ""
            raise NotACertificate(f"{path}: a list{length} is needed")
        return [
            read_shape(part, shape[0], f"{path} {number}") for number, part in enumerate(value, 1)
        ]
    try:
        return shape(value)
    except ValueError as fault:
        raise NotACertificate(f"{path}: {fault}") from None


class ClaimReader(dict[str, Any]):
    """The claim of a certificate as a dictionary that records, in ``names_read``, which members
    were read.

    A member that is never read is never tested.
    """

    def __init__(self, members: Mapping[str, Any]) -> None:
        super().__init__(members)
        self.names_read: set[str] = set()

    def __getitem__(self, name: str) -> Any:
        self.names_read.add(name)
        return super().__getitem__(name)

    def get(self, name: str, default: Any = None) -> Any:
        """Return a member of the claim, or the default if it is missing. Record that it
        was read.
        """
        self.names_read.add(name)
        return super().get(name, default)


NUMBER_SHAPE = {"value": read_decimal, "uncertainty": read_decimal}


def _unique_members(pairs: Sequence[tuple[str, Any]]) -> dict[str, Any]:
    if len({name for name, _ in pairs}) < len(pairs):
        raise NotACertificate("an object has two members of the same name")
    return dict(pairs)


def _refuse_float(text: str) -> NoReturn:
    raise NotACertificate(
        f"a number is written as {text[:40]}: numbers that are not whole are texts here"
    )


def read_json(path: str) -> Any:
    """Return the content of a JSON file. Raises NotACertificate if it cannot be read."""
    try:
        if not os.path.isfile(path):
            raise NotACertificate("there is no such file, or it is not a regular one")
        with open(path, "rb") as stream:
            raw = stream.read(_MAX_FILE + 1)
        if len(raw) > _MAX_FILE:
            raise NotACertificate(f"it is larger than {_MAX_FILE} bytes")
        return json.loads(
            raw,
            object_pairs_hook=_unique_members,
            parse_float=_refuse_float,
            parse_constant=_refuse_float,
        )
    except OSError as fault:
        raise NotACertificate(f"it cannot be read: {fault.strerror}") from None
    except (ValueError, RecursionError):
        raise NotACertificate("it is not JSON") from None


def digest(content: dict[str, Any]) -> str:
    """Return the SHA-256 digest of a certificate or manifest.

    It covers all members but the digest itself, as JSON with sorted keys and no spaces.
    """
    rest = {name: value for name, value in content.items() if name != "sha256"}
    return hashlib.sha256(
        json.dumps(rest, sort_keys=True, separators=(",", ":")).encode()
    ).hexdigest()


# --------------------------------------------------------------------------- common to all
class FrictionTraits(NamedTuple):
    """The properties of a friction law that proofs need, besides its formula in `vector_field`."""

    title: str  #: its name in a sentence
    two_sided: bool  #: True if its two sides, at gamma_y = 0, are different analytic functions


FRICTION_LAWS = {
    "linear": FrictionTraits("linear", False),
    "smooth": FrictionTraits("smooth Coulomb", True),
}

#: The names of an orbit by its stability. Unlike a limit cycle, an undecided one need not be
#: isolated.
STABILITY_WORDS = {
    True: "a limit cycle, asymptotically stable",
    False: "a limit cycle, unstable",
    None: "a periodic orbit, of undecided stability",
}

#: The members that every claim has: its kind, its disk and its friction law
DISK_SHAPE = {
    "kind": str,
    "parameters": dict.fromkeys(PARAMETER_UNITS, read_decimal),
    "friction": one_of(*FRICTION_LAWS),
}


def require_claimed_enclosure(number: Mapping[str, str], x: Any, name: str) -> None:
    """Raise Unproved unless the ball ``x`` lies within the half-width of the claimed ``number``.

    The message contains ``name``.
    """
    with working_precision(
        2 * working_bits()
    ):  # a half-width may be a few last bits only, and rounding must not exceed it
        within = x.is_finite() and abs(x - ball(Fraction(number["value"]))) <= ball(
            Fraction(number["uncertainty"])
        )
    require(bool(within), f"claim: {name} is not shown to lie within its uncertainty")
