"""The list of the report's exhibits, in the order of the paper, followed by our own studies."""

from __future__ import annotations

from collections.abc import Sequence

from tippedisk_verify.audit.catalogue import claims_drawn_in
from tippedisk_verify.figures import eigenvalues, family, inversion, race, state_space
from tippedisk_verify.figures.exhibit import Exhibit

__all__ = ["EXHIBITS", "exhibits_for"]

EXHIBITS: tuple[Exhibit, ...] = (
    inversion.inversion,
    eigenvalues.eigenvalues,
    family.branch,
    state_space.scenes_3d,
    family.scenario,
    state_space.scenes_2d,
    race.race,
)


def exhibits_for(claims: Sequence[str]) -> tuple[Exhibit, ...]:
    """Return the figures of the report that illustrate some of these claims."""
    return tuple(
        exhibit for exhibit in EXHIBITS if not set(claims_drawn_in(exhibit.name)).isdisjoint(claims)
    )
