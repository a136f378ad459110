"""Studies of accuracy: close to Omega_h, and at the smooth law's switches."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import partial
from typing import Any

from tippedisk_verify.audit.claims import Audit
from tippedisk_verify.audit.near_omega_h import Sight
from tippedisk_verify.audit.near_omega_h import near_omega_h as sights_near
from tippedisk_verify.audit.switching_order import OrderPoint
from tippedisk_verify.audit.switching_order import switching_order as order_points
from tippedisk_verify.connection.heteroclinic import Heteroclinic
from tippedisk_verify.figures.exhibit import Drawing, Exhibit, table
from tippedisk_verify.figures.style import BLACK, GREEN, grid

__all__ = ["draw_near_omega_h", "draw_switching_order", "near_omega_h", "switching_order"]

_LEAST = 1e-17  # an error of zero has no logarithm: it sits on the lower edge


def draw_near_omega_h(sights: Sequence[Sight], connection: Heteroclinic, constant: float, columns: int = 3) -> Any:
    """Close to Omega_h: the period and what its law leaves, and what double precision loses."""
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
    draw(error, "o", held, lambda s: max(s.period_error, _LEAST), "T in double (none: lower edge)")
    draw(error, "x", [s for s in sights if s not in held], lambda s: 1.0, "no cycle in double")
    draw(error, "--", sights, lambda s: s.expected_error, "rounding of Ω alone")
    for axis, name in zip(axes, ("period T [s]", "what the law leaves of T [s]", "error of T [s]"), strict=True):
        scale = "linear" if axis is period else "log"
        axis.set(xscale="log", yscale=scale, xlabel=r"$\Omega - \Omega_\mathrm{h}$ [rad/s]", ylabel=name)
        axis.legend(fontsize=8)
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


def draw_switching_order(points: Sequence[OrderPoint], columns: int = 2) -> Any:
    """Error against tolerance, with and without switching the smooth law's branch."""
    figure, axes = grid(2, columns, (4.6, 3.3))
    errors = [max(point.error, _LEAST) for point in points]
    names = {"taylor": "taylor, switching its branch", "scipy-DOP853": "DOP853, not switching"}
    for axis, (method, title) in zip(axes, names.items(), strict=True):
        for law, line, colour in (("linear", "o--", BLACK), ("smooth", "s-", GREEN)):
            chosen = [point for point in points if point.method == method and point.friction == law]
            ends = [max(point.error, _LEAST) for point in chosen]
            axis.loglog([p.tolerance for p in chosen], ends, line, lw=1.0, color=colour, label=f"{law} law")
        axis.set(title=title, xlabel="tolerance [1]", ylabel="error after 3 s [rad or rad/s]")
        axis.set_ylim(min(errors) / 3, 3 * max(errors))
        axis.legend()
    return figure


@partial(
    Exhibit,
    name="switching_order",
    title="Both friction laws: error against tolerance",
    alternative="Two panels, error against tolerance for the linear and the smooth law: the Taylor engine has the "
    "same order for both, DOP853 loses its order for the smooth law at tight tolerances.",
    cost=5,
)
def switching_order(audit: Audit, examined: Sequence[str]) -> Drawing:
    points = order_points(audit.parameters)
    tightest = min(point.tolerance for point in points)
    ends = {(p.method, p.friction): p.error for p in points if p.tolerance == tightest}
    rows = [(point.method, point.friction, point.tolerance, point.error) for point in points]
    return Drawing(
        figure=lambda columns: draw_switching_order(points, columns),
        columns=2,
        reading="With the smooth law at the tightest tolerance, DOP853 is left with an error of "
        f"{ends['scipy-DOP853', 'smooth']:.1g}; the Taylor engine, which switches its branch where the disk rolls, has "
        f"{ends['taylor', 'smooth']:.1g}.",
        data={"switching_order.csv": (("method", "friction law", "tolerance [1]", "error [rad or rad/s]"), rows)},
    )
