"""Cycles close to Omega_h: the period's law, and what double precision loses."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import partial
from typing import Any

from tippedisk_verify.audit.claims import Audit
from tippedisk_verify.audit.near_omega_h import Sight
from tippedisk_verify.audit.near_omega_h import near_omega_h as sights_near
from tippedisk_verify.connection.heteroclinic import Heteroclinic
from tippedisk_verify.figures.exhibit import Drawing, Exhibit, table
from tippedisk_verify.figures.style import BLACK, GREEN, grid

__all__ = ["draw_near_omega_h", "near_omega_h"]

_LEAST = 1e-17  # an error of zero has no logarithm: it sits on the lower edge


def draw_near_omega_h(sights: Sequence[Sight], connection: Heteroclinic, constant: float, columns: int = 3) -> Any:
    """Close to Omega_h: the period and what its law leaves, and what double precision loses."""
    from matplotlib.ticker import LogLocator

    figure, axes = grid(3, columns, (3.2, 3.3) if columns > 1 else (4.6, 3.3))
    unstable, slow, _ = (float(value) for value in connection.saddle_eigenvalues)
    falling = [sight for sight in sights if sight.distance < 0.1]
    power = -slow / unstable - 1
    factor = abs(falling[-1].remainder) / falling[-1].distance ** power

    def draw(axis: Any, line: str, points: Sequence[Sight], value: Any, label: str) -> None:
        colour = BLACK if line in ("--", "x") else GREEN
        axis.plot([s.distance for s in points], list(map(value, points)), line, color=colour, label=label, lw=1.0)

    period, rest, error = axes
    draw(period, "o", sights, lambda s: s.period, "limit cycles")
    law = r"$c - (2/\lambda_u)\,\log(\Omega - \Omega_\mathrm{h})$"
    draw(period, "--", sights, lambda s: constant - 2 / unstable * math.log(s.distance), law)
    draw(rest, "o", falling, lambda s: abs(s.remainder), "law − T")
    law = rf"power {power:.3f} = $|\lambda_s|/\lambda_u - 1$"
    draw(rest, "--", falling, lambda s: factor * s.distance**power, law)
    held = [sight for sight in sights if sight.period_error is not None]
    draw(error, "o", held, lambda s: max(s.period_error, _LEAST), "T in double")
    draw(error, "x", [s for s in sights if s not in held], lambda s: 1.0, "no cycle in double")
    draw(error, "--", sights, lambda s: s.expected_error, "rounding of Ω alone")
    for axis, name in zip(axes, ("period T [s]", "what the law leaves of T [s]", "error of T [s]"), strict=True):
        scale = "linear" if axis is period else "log"
        axis.set(xscale="log", yscale=scale, xlabel=r"$\Omega - \Omega_\mathrm{h}$ [rad/s]", ylabel=name)
        axis.xaxis.set_major_locator(LogLocator(numticks=5))
        axis.legend(fontsize=8, loc="lower left" if axis is error else "best")
    return figure


@partial(
    Exhibit,
    name="near_omega_h",
    title="Close to Omega_h: the period's law, and what double precision loses",
    alternative="Three panels against the distance from Omega_h on a logarithmic axis: the period follows a "
    "straight line, what the line leaves falls like a power, and the error of double grows until it finds no cycle.",
    laws=("linear",),
    cost=12,
)
def near_omega_h(audit: Audit, examined: Sequence[str]) -> Drawing:
    connection, constant, sights = sights_near(audit.parameters, audit.engine)
    near = sorted(sights, key=lambda sight: -sight.distance)
    rows = [(s.distance, s.period, s.remainder, s.period_error, s.state_error, s.expected_error) for s in near]
    header = (
        "Omega - Omega_h [rad/s]",
        "T [s]",
        "T - law [s]",
        "error of T in double [s]",
        "relative error of pi - gamma_bar_0 in double [1]",
        "largest error of T from rounding Omega [s]",
    )
    last = [sight for sight in near if sight.period_error is not None][-1]
    unstable = float(connection.saddle_eigenvalues[0])
    return Drawing(
        figure=lambda columns: draw_near_omega_h(near, connection, constant, columns),
        columns=3,
        reading=f"Each tenth of the distance adds {2 * math.log(10) / unstable:.3g} s to the period and takes a digit "
        f"from it in double, which finds none of the cycles closer than {last.distance:.1g} rad/s; quadruple precision "
        f"goes on to {near[-1].distance:.1g}.",
        data={"near_omega_h.csv": (header, rows)},
        tables=(
            table(
                "Limit cycles close to Omega_h, in quadruple precision, and what double precision makes of them. The "
                f"law: T = c - (2 / lambda_u) log(Omega - Omega_h), c = {constant:.8f} s, with natural logarithms of "
                f"rad/s and the unstable eigenvalue of noninverted spinning, lambda_u = {unstable:.8g} 1/s; it leaves "
                "a power of the distance. All digits are in near_omega_h.csv. An empty cell: double finds no cycle.",
                header,
                rows,
            ),
        ),
        facts={"connection": connection.to_dict(), "law_constant": constant},
    )
