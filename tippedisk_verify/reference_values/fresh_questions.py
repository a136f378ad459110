"""Fresh questions: states, speeds and disks drawn from a seed, with answers computed on demand.

They are of levels 1 to 7, with ten states for each disk. A question's id holds the seed and the
disk's number, so the same inputs can be drawn again from the id: grading needs only the answers.
Each true value comes from its kind's first method (in double for an orbit or a cycle), with the
half-width that this method gives.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from fractions import Fraction
from functools import lru_cache

from tippedisk_verify.errors import InputError
from tippedisk_verify.model.friction import Friction
from tippedisk_verify.reference_values.drawn_disks import DRAWN_SET, Draw, drawn_disk
from tippedisk_verify.reference_values.entries import (
    READINGS,
    Reading,
    ReferenceEntry,
    case_of,
)
from tippedisk_verify.reference_values.store import ReferenceValue, Store, load_store
from tippedisk_verify.reference_values.truths import (
    as_reference_value,
    as_reference_values,
    sensitivities,
    true_values,
)
from tippedisk_verify.theory.hopf import omega_crit

__all__ = ["MAX_STATES", "STATES_PER_DISK", "blank_questions", "fresh_entry_ids", "with_fresh"]

STATES_PER_DISK = 10
MAX_STATES = 1000  #: the maximum on one sheet
_LAWS: tuple[Friction, ...] = ("linear", "smooth")
_SAMPLE_TIMES = ("0.5", "1", "1.5", "2")
_DIGITS = 12  # of orbits and cycles, which double precision reaches
_ABOUT_HALF_PI = Fraction("1.5708")
_ENTRY_ID = re.compile(
    rf"(?<![\w-]){DRAWN_SET.pattern}/(both|linear|smooth)/[a-z-]+/[A-Za-z0-9.+-]+"
)
_MAX_ENTRIES = 42 * MAX_STATES // STATES_PER_DISK  # the maximum on one sheet; a disk has 42


@lru_cache(maxsize=MAX_STATES // STATES_PER_DISK)
def _entries_of_disk(set_name: str) -> tuple[ReferenceEntry, ...]:
    """Return all entries of a disk that was drawn at random, easiest first."""
    return tuple(_drawn_entries(set_name))


def _drawn_entries(set_name: str) -> Iterator[ReferenceEntry]:
    drawn = DRAWN_SET.fullmatch(set_name)
    assert drawn is not None
    draw = Draw(int(drawn[1]), int(drawn[2]))
    crit = omega_crit(drawn_disk(draw.seed, draw.number), 40).value

    def speed_near_crit(name: str, below: str, above: str, places: int) -> str:
        """Draw a random speed by its relative distance from Omega_crit, as a decimal.

        ``name`` is that of the draw, ``below`` and ``above`` are the bounds of the relative
        distance, and ``places`` is the number of decimal places.
        """
        return draw.decimal_between(
            name, crit * (1 + Fraction(below)), crit * (1 + Fraction(above)), places
        )

    def entry(law: str, kind: str, name: str, **inputs: str) -> ReferenceEntry:
        return ReferenceEntry(f"{set_name}/{law}/{kind}/{name}", inputs)

    for n in range(1, STATES_PER_DISK + 1):
        place = f"{n:02d}"
        # A quarter of the speeds come from a wide range, the others lie near Omega_crit. A tenth of
        # the states lie near beta = pi/2.
        speed = (
            draw.decimal_between(f"Omega {n}", 5, 60, 4)
            if n % 4 == 0
            else speed_near_crit(f"Omega {n}", "-0.05", "0.05", 4)
        )
        width = Fraction("0.0015") if n % 10 == 0 else Fraction("1.5")
        state = {
            "beta": draw.decimal_between(
                f"beta {n}", _ABOUT_HALF_PI - width, _ABOUT_HALF_PI + width, 6
            ),
            "gamma": draw.decimal_between(
                f"gamma {n}", _ABOUT_HALF_PI - Fraction("4.7"), _ABOUT_HALF_PI + Fraction("4.7"), 5
            ),
            "v": draw.decimal_between(f"v {n}", -12, 12, 4),
        }
        for law in ("both", *_LAWS):
            yield entry(law, "rhs", place, Omega=speed, **state)
    for n, speed in enumerate(
        (
            draw.decimal_between("equilibrium 1", 5, 60, 4),
            speed_near_crit("equilibrium 2", "-0.05", "0.05", 4),
        ),
        1,
    ):
        for name in ("inverted", "noninverted"):
            yield entry("both", "equilibrium", f"{name}-{n}", Omega=speed, equilibrium=name)
    yield entry("linear", "hopf", "point")
    speed = speed_near_crit("harmonic balance", "-0.02", "-0.0001", 6)
    for form in ("printed", "consistent"):
        yield entry("linear", "harmonic-balance", form, Omega=speed, form=form)
    angles = {
        "beta": draw.decimal_between("slow beta", "0.8", "2.3", 4),
        "gamma": draw.decimal_between("slow gamma", "-1.5", "4.5", 4),
    }
    yield entry(
        "linear",
        "slow-manifold",
        "1",
        Omega=speed_near_crit("slow speed", "-0.03", "0.03", 4),
        **angles,
    )
    # Near inverted spinning: from there the disk does not lie flat within two seconds.
    start = {
        "beta": draw.decimal_between(
            "orbit beta", _ABOUT_HALF_PI - Fraction("0.3"), _ABOUT_HALF_PI + Fraction("0.3"), 4
        ),
        "gamma": draw.decimal_between(
            "orbit gamma", _ABOUT_HALF_PI - Fraction("0.8"), _ABOUT_HALF_PI + Fraction("0.8"), 4
        ),
        "v": draw.decimal_between("orbit v", -2, 2, 4),
    }
    for law in _LAWS:
        yield entry(
            law,
            "trajectory",
            "1",
            Omega=speed_near_crit("orbit speed", "-0.03", "0.03", 4),
            **start,
        )
    # Omega_h lies at least a fiftieth below Omega_crit for these disks.
    for law in _LAWS:
        yield entry(
            law, "limit-cycle", "1", Omega=speed_near_crit("cycle speed", "-0.01", "-0.001", 6)
        )


# ----------------------------------------------------------------------------------------- answers
def blank_questions(states: int, seed: int) -> Store:
    """Return fresh questions about disks drawn from a seed, without answers.

    Args:
        states: The number of states, from 1 to `MAX_STATES`. There are ten to a disk, with the
            other questions about that disk.
        seed: The seed, from 0 to 999999999.

    Raises:
        InputError: If a number is out of its range.
    """
    if not 1 <= states <= MAX_STATES:
        raise InputError(f"--states is a number from 1 to {MAX_STATES}, not {states}")
    if not 0 <= seed < 10**9:
        raise InputError(f"--seed is a number from 0 to 999999999, not {seed}")
    disks = -(-states // STATES_PER_DISK)
    last = states - (disks - 1) * STATES_PER_DISK
    left_out = {f"/rhs/{n:02d}" for n in range(last + 1, STATES_PER_DISK + 1)}
    entries = [
        entry
        for number in range(1, disks + 1)
        for entry in _entries_of_disk(f"fresh-{seed}-{number}")
        if number < disks or entry.id[-7:] not in left_out
    ]
    no_values: dict[Reading, tuple[str, str]] = {"decimals": ("", ""), "doubles": ("", "")}
    blank = (
        as_reference_value(entry, name, no_values, {})
        for entry in entries
        for name in _asked_quantities(entry.kind, entry.friction)
    )
    return Store.of(sorted(blank, key=lambda question: question.level))


def fresh_entry_ids(prefix: str) -> str:
    """Return the ids of the fresh entries that start with a prefix, as text with one id per line.

    The disk of a fresh entry is drawn from a seed. For the id of a quantity, return the id of the
    entry that the quantity belongs to.
    """
    drawn = re.match(rf"{DRAWN_SET.pattern}(?=/)", prefix)
    entries = () if drawn is None else _entries_of_disk(drawn[0])
    return "\n".join(
        entry.id
        for entry in entries
        if entry.id.startswith(prefix) or prefix.startswith(f"{entry.id}/")
    )


def with_fresh(
    store: Store, text: str, advance: Callable[[str, int], None] = lambda label, steps: None
) -> Store:
    """Add to a store the true values of all fresh questions whose ids occur in a text.

    Ids that no seed gives are ignored. A true value is computed once in a process.

    Args:
        store: The store to extend.
        text: Any text, such as a sheet of answers.
        advance: A function that is called with an id and 1 after each entry.

    Raises:
        InputError: If there are more questions than `MAX_STATES` states give.
    """
    named = {found[0] for found in _ENTRY_ID.finditer(text)}
    if len(named) > _MAX_ENTRIES:
        raise InputError(
            f"there are fresh questions for {len(named)} entries: a sheet has "
            f"{_MAX_ENTRIES} at most"
        )
    sets = dict.fromkeys(id_.split("/")[0] for id_ in sorted(named))
    wanted = [entry for name in sets for entry in _entries_of_disk(name) if entry.id in named]
    truths: list[ReferenceValue] = []
    for entry in wanted:
        truths += _true_values_of(entry.id)
        advance(entry.id, 1)
    return (
        store.merged_with(Store.of(sorted(truths, key=lambda question: question.level)))
        if truths
        else store
    )


@lru_cache(maxsize=_MAX_ENTRIES)
def _true_values_of(entry_id: str) -> tuple[ReferenceValue, ...]:
    entry = next(
        entry for entry in _entries_of_disk(entry_id.split("/")[0]) if entry.id == entry_id
    )
    values = {reading: true_values(case_of(entry, reading), _DIGITS) for reading in READINGS}
    slopes = sensitivities(case_of(entry, "decimals"), values["decimals"])
    names = _asked_quantities(entry.kind, entry.friction)
    return tuple(as_reference_values(entry, names, values, slopes))


@lru_cache(maxsize=32)
def _asked_quantities(kind: str, friction: str) -> tuple[str, ...]:
    """Return the names of the quantities that are asked about a fresh entry of a kind and friction
    law, as in the published data.

    For orbits, keep only those at the times of a drawn orbit.
    """
    published = load_store().matching(f"table1/{friction}/{kind}/")
    first = published[0].id.rsplit("/", 1)[0]
    names = [
        reference_value.name
        for reference_value in published
        if reference_value.id.startswith(f"{first}/")
    ]
    return tuple(
        name for name in names if kind != "trajectory" or name.partition("@")[2] in _SAMPLE_TIMES
    )
