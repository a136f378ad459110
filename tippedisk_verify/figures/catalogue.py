"""All exhibits of the report, in the order of the paper, studies of our own after them."""

from __future__ import annotations

from collections.abc import Sequence

from tippedisk_verify.audit.catalogue import claims_drawn_in
from tippedisk_verify.figures import disk, family, local, race, state_space
from tippedisk_verify.figures.exhibit import Exhibit

__all__ = ["EXHIBITS", "exhibits_for"]

EXHIBITS: tuple[Exhibit, ...] = (
    disk.inversion,
    local.eigenvalues,
    family.branch,
    state_space.scenes_3d,
    family.scenario,
    state_space.scenes_2d,
    race.race,
)


def exhibits_for(claims: Sequence[str]) -> tuple[Exhibit, ...]:
    """The exhibits that go with these claims."""
    return tuple(one for one in EXHIBITS if not set(claims_drawn_in(one.name)).isdisjoint(claims))
