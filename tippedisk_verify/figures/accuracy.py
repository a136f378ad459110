"""Cycles close to Omega_h: the period and its law, from the cycles that the audit's claim follows."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import partial
from typing import Any

from tippedisk_verify.audit.claims import Audit
from tippedisk_verify.figures.exhibit import Drawing, Exhibit
from tippedisk_verify.figures.style import BLACK, GREEN, grid

__all__ = ["draw_near_omega_h", "near_omega_h"]

Rows = Sequence[tuple[float, float, float]]


def draw_near_omega_h(rows: Rows, unstable: float, power: float, columns: int = 2) -> Any:
    """Period and slope of the law against the distance from Omega_h.

    ``rows`` are (distance [rad/s], period [s], slope over the law's), ``unstable`` is lambda_u [1/s] and ``power`` the
    one of the law's remainder.
    """
    figure, (period, slope) = grid(2, columns, (4.6, 3.3))
    distances = [row[0] for row in rows]
    last, longest, left = rows[-1]
    law = [longest - 2 / unstable * math.log(distance / last) for distance in distances]
    period.plot(distances, [row[1] for row in rows], "o", color=GREEN, label="limit cycles")
    period.plot(
        distances, law, "--", color=BLACK, lw=1.0, label=r"$c - (2/\lambda_u)\,\log(\Omega - \Omega_\mathrm{h})$"
    )
    slope.plot(distances, [abs(row[2] - 1) for row in rows], "o", color=GREEN, label="limit cycles")
    label = rf"power {power:.3f} = $|\lambda_s|/\lambda_u - 1$"
    remainder = [abs(left - 1) * (distance / last) ** power for distance in distances]
    slope.plot(distances, remainder, "--", color=BLACK, lw=1.0, label=label)
    slope.set_yscale("log")
    for axis, name in ((period, "period T [s]"), (slope, "slope of T over the law's, less 1 [1]")):
        axis.set(xscale="log", xlabel=r"$\Omega - \Omega_\mathrm{h}$ [rad/s]", ylabel=name)
        axis.legend()
    return figure


@partial(
    Exhibit,
    name="near_omega_h",
    title="Close to Omega_h: the period's law",
    alternative="Two panels against the distance from Omega_h on a logarithmic axis: the period follows a straight "
    "line, and how far its slope is from the law's falls like a power.",
    laws=("linear",),
)
def near_omega_h(audit: Audit, examined: Sequence[str]) -> Drawing:
    approach = audit.approach(audit.parameters.name)
    unstable, slow, _ = (float(value) for value in audit.connection(audit.parameters.name).saddle_eigenvalues)
    rows = [row for row in approach.law_rows(unstable) if row[0] < 0.1]
    last = rows[-1]
    return Drawing(
        figure=lambda columns: draw_near_omega_h(rows, unstable, -slow / unstable - 1, columns),
        columns=2,
        reading=f"Each tenth of the distance adds {2 * math.log(10) / unstable:.3g} s to the period, which is "
        f"{last[1]:.3g} s at {last[0]:.1g} rad/s above Omega_h; the slope there is {last[2]:.4f} of the law's.",
        data={
            "near_omega_h.csv": (("Omega - Omega_h [rad/s]", "T [s]", "slope of T over the law's [1]"), rows),
        },
    )
