"""The list of the report's exhibits, in the order of the paper, followed by our own studies."""

from __future__ import annotations

from collections.abc import Sequence

from tippedisk_verify.audit.claim_catalogue import claims_drawn_in
from tippedisk_verify.figures import (
    eigenvalue_figure,
    family_figures,
    inversion_figure,
    race_figure,
    scene_figures,
)
from tippedisk_verify.figures.exhibit import Exhibit

__all__ = ["EXHIBITS", "exhibits_for"]

EXHIBITS: tuple[Exhibit, ...] = (
    inversion_figure.inversion_exhibit,
    eigenvalue_figure.eigenvalue_exhibit,
    family_figures.family_exhibit,
    scene_figures.scenes_3d_exhibit,
    family_figures.scenario_exhibit,
    scene_figures.scenes_2d_exhibit,
    race_figure.race_exhibit,
)


def exhibits_for(claims: Sequence[str]) -> tuple[Exhibit, ...]:
    """Return the figures of the report that illustrate some of these claims."""
    return tuple(
        exhibit for exhibit in EXHIBITS if not set(claims_drawn_in(exhibit.name)).isdisjoint(claims)
    )
