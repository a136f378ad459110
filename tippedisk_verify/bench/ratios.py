"""Who is fastest for a given error: the race's scores as ratios, each from one run."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass
from typing import Any

from tippedisk_verify.bench.race import Score

__all__ = ["BOUNDS", "Ratio", "ratios"]

BOUNDS = (1e-4, 1e-6, 1e-8, 1e-10, 1e-12, 1e-13)
_GROUPS = {"heyoka": ("heyoka",), "scipy": ("scipy",), "peer": ("cvode", "diffrax")}


@dataclass(frozen=True)
class Ratio:
    """The fastest of each group with an error within the bound; None where none of them gets there or was raced."""

    problem: str
    error_at_most: float
    heyoka: str | None  #: method and setting
    heyoka_seconds: float | None
    scipy: str | None
    scipy_over_heyoka: float | None  #: how many times longer SciPy takes
    peer: str | None
    peer_over_heyoka: float | None

    def json(self) -> dict[str, Any]:
        return asdict(self)


def ratios(scores: Sequence[Score], bounds: Iterable[float] = BOUNDS) -> list[Ratio]:
    """By problem and bound; bounds that nobody reaches are left out."""
    rows = []
    for problem in dict.fromkeys(score.problem for score in scores):
        here = [score for score in scores if score.problem == problem]
        for bound in bounds:
            best = {name: _fastest(here, families, bound) for name, families in _GROUPS.items()}
            if any(best.values()):
                rows.append(_ratio(problem, bound, best))
    return rows


def _fastest(scores: Sequence[Score], families: Sequence[str], bound: float) -> Score | None:
    within = [s for s in scores if s.family in families and s.error is not None and s.error <= bound and s.seconds]
    return min(within, key=lambda score: score.seconds or 0.0, default=None)


def _ratio(problem: str, bound: float, best: dict[str, Score | None]) -> Ratio:
    ours = best["heyoka"]

    def over(name: str) -> float | None:
        theirs = best[name]
        return None if ours is None or theirs is None else (theirs.seconds or 0.0) / (ours.seconds or 1.0)

    labels = {name: None if score is None else f"{score.method} {score.setting}" for name, score in best.items()}
    return Ratio(
        problem, bound, labels["heyoka"], None if ours is None else ours.seconds,
        labels["scipy"], over("scipy"), labels["peer"], over("peer"),
    )  # fmt: skip
