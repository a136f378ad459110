"""All exhibits of the report, in the order of the paper, studies of our own after them."""

from __future__ import annotations

from collections.abc import Sequence

from tippedisk_verify.audit.catalogue import claims_drawn_in
from tippedisk_verify.figures import accuracy, disk, family, local, race, state_space
from tippedisk_verify.figures.exhibit import Exhibit

__all__ = ["EXHIBITS", "exhibits_for"]

EXHIBITS: tuple[Exhibit, ...] = (
    disk.inversion,
    local.eigenvalues,
    family.branch,
    state_space.scenes_3d,
    family.scenario,
    state_space.scenes_2d,
    accuracy.near_omega_h,
    race.race,
)


def exhibits_for(claims: Sequence[str], friction: str) -> tuple[Exhibit, ...]:
    """The exhibits that go with these claims under this friction law."""
    return tuple(
        exhibit
        for exhibit in EXHIBITS
        if friction in exhibit.laws and not set(claims_drawn_in(exhibit.name)).isdisjoint(claims)
    )
