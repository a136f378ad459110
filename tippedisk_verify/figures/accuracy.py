"""Studies of accuracy: close to Omega_h, and at the smooth law's switches."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from tippedisk_verify.audit.claims import Audit
from tippedisk_verify.audit.near_omega_h import Sight, near_omega_h
from tippedisk_verify.audit.switching_order import OrderPoint, switching_order
from tippedisk_verify.connection.heteroclinic import Heteroclinic
from tippedisk_verify.figures.exhibit import Drawing, Exhibit, Table
from tippedisk_verify.figures.style import BLACK, GREEN, grid

__all__ = ["EXHIBITS", "draw_near_omega_h", "draw_switching_order"]

_DISTANCE = r"$\Omega - \Omega_\mathrm{h}$ [rad/s]"
_LEAST = 1e-17  # an error of zero has no logarithm: it sits on the lower edge


def draw_near_omega_h(sights: Sequence[Sight], connection: Heteroclinic, constant: float, columns: int = 3) -> Any:
    """Close to Omega_h: the period and what its law leaves, and what double precision loses."""
    near = sorted(sights, key=lambda sight: -sight.distance)
    distance = [sight.distance for sight in near]
    unstable, slow, _ = (float(value) for value in connection.saddle_eigenvalues)
    figure, axes = grid(3, columns, (3.9, 3.5))
    law = [constant - 2 / unstable * math.log(value) for value in distance]
    axes[0].semilogx(distance, [sight.period for sight in near], "o", ms=4, color=GREEN, label="limit cycles")
    label = r"$-(2/\lambda_u)\,\log(\Omega - \Omega_\mathrm{h}) + c$"
    axes[0].semilogx(distance, law, "--", color=BLACK, lw=1.0, label=label)
    axes[0].set_ylabel("period T [s]")
    falling = [(sight.distance, abs(sight.remainder)) for sight in near if sight.distance < 0.1]
    power = -slow / unstable - 1
    through = falling[-1][1] / falling[-1][0] ** power
    label = rf"power {power:.3f} = $|\lambda_s|/\lambda_u - 1$"
    axes[1].loglog(*zip(*falling, strict=True), "o", ms=4, color=GREEN, label="law − T")
    axes[1].loglog(
        [x for x, _ in falling], [through * x**power for x, _ in falling], "--", color=BLACK, lw=1.0, label=label
    )
    axes[1].set_ylabel("what the law leaves of T [s]")
    seen = [(s.distance, max(s.period_error, _LEAST)) for s in near if s.period_error is not None]
    lost = [sight.distance for sight in near if sight.period_error is None]
    axes[2].loglog(*zip(*seen, strict=True), "o", ms=4, color=GREEN, label="T in double (no error: lower edge)")
    if lost:
        axes[2].loglog(lost, [1.0] * len(lost), "x", ms=6, color=BLACK, label="double finds no cycle (upper edge)")
    axes[2].loglog(distance, [s.expected_error for s in near], "--", color=BLACK, lw=1.0, label="rounding of Ω alone")
    axes[2].set_ylabel("error of T [s]")
    for axis in axes:
        axis.set_xlabel(_DISTANCE)
        axis.grid(lw=0.3, alpha=0.5)
        axis.legend(frameon=False, fontsize=8)
    return figure


def _near_omega_h(audit: Audit, examined: Sequence[str]) -> Drawing:
    connection, constant, sights = near_omega_h(audit.parameters, audit.engine)
    near = sorted(sights, key=lambda sight: -sight.distance)
    rows = [(s.distance, s.period, s.remainder, s.period_error, s.state_error, s.expected_error) for s in near]
    header = (
        "Omega - Omega_h [rad/s]",
        "T [s]",
        "T - law [s]",
        "error of T in double [s]",
        "relative error of pi - gamma_bar_0 in double",
        "error of T from rounding Omega, at most [s]",
    )
    last = [sight for sight in near if sight.period_error is not None][-1]
    decade = 2 * math.log(10) / float(connection.saddle_eigenvalues[0])
    return Drawing(
        figure=lambda columns: draw_near_omega_h(sights, connection, constant, columns),
        columns=3,
        reading=f"Each tenth of the distance adds {decade:.3g} s to the period and takes a digit from it in "
        f"double, which finds none of the cycles closer than {last.distance:.1g} rad/s; quadruple precision goes on "
        f"to {near[-1].distance:.1g}.",
        data={"near_omega_h.csv": (header, [["" if cell is None else cell for cell in row] for row in rows])},
        tables=(
            Table.of(
                "Limit cycles close to Omega_h, in quadruple precision, and what double precision makes of them. The "
                f"law: T = c - (2 / lambda_u) log(Omega - Omega_h), c = {constant:.8f} s, with natural logarithms of "
                "rad/s and the unstable eigenvalue of noninverted spinning, "
                f"lambda_u = {float(connection.saddle_eigenvalues[0]):.8g} 1/s; it leaves a power of the distance. "
                "All digits are in near_omega_h.csv. An empty cell: double finds no cycle.",
                header,
                rows,
            ),
        ),
        facts={"connection": connection.to_dict(), "law_constant": constant},
    )


def draw_switching_order(points: Sequence[OrderPoint], columns: int = 2) -> Any:
    """Error against tolerance, with and without switching the smooth law's branch."""
    figure, axes = grid(2, columns, (4.3, 3.3))
    low = min(max(point.error, _LEAST) for point in points) / 3
    high = 3 * max(point.error for point in points)
    names = {"taylor": "taylor, switching its branch", "scipy-DOP853": "DOP853, not switching"}
    for axis, (method, title) in zip(axes, names.items(), strict=True):
        for law, style in (("linear", "o--"), ("smooth", "s-")):
            chosen = [point for point in points if point.method == method and point.friction == law]
            axis.loglog(
                [point.tolerance for point in chosen],
                [max(point.error, _LEAST) for point in chosen],
                style,
                ms=4,
                lw=1.0,
                color=BLACK if law == "linear" else GREEN,
                label=f"{law} law",
            )
        axis.set(ylim=(low, high), title=title, xlabel="tolerance [1]", ylabel="error after 3 s [rad, rad/s]")
        axis.grid(lw=0.3, alpha=0.5)
        axis.legend(frameon=False)
    return figure


def _switching_order(audit: Audit, examined: Sequence[str]) -> Drawing:
    points = switching_order(audit.parameters)
    tightest = min(point.tolerance for point in points)
    ends = {(p.method, p.friction): p.error for p in points if p.tolerance == tightest}
    rows = [(point.method, point.friction, point.tolerance, point.error) for point in points]
    return Drawing(
        figure=lambda columns: draw_switching_order(points, columns),
        columns=2,
        reading="With the smooth law at the tightest tolerance, DOP853 is left with an error of "
        f"{ends['scipy-DOP853', 'smooth']:.1g}; the Taylor engine, which switches its branch where the disk rolls, has "
        f"{ends['taylor', 'smooth']:.1g}.",
        data={"switching_order.csv": (("method", "friction law", "tolerance", "error [rad, rad/s]"), rows)},
    )


EXHIBITS = (
    Exhibit(
        name="near_omega_h",
        title="Close to Omega_h: the period's law, and what double precision loses",
        source="",
        alternative="Three panels against the distance from Omega_h on a logarithmic axis: the period follows a "
        "straight line, what the line leaves falls like a power, and the error of double grows until it finds no "
        "cycle.",
        draw=_near_omega_h,
        laws=("linear",),
        cost=12,
    ),
    Exhibit(
        name="switching_order",
        title="Both friction laws: error against tolerance",
        source="",
        alternative="Two panels, error against tolerance for the linear and the smooth law: the Taylor engine has the "
        "same order for both, DOP853 loses its order for the smooth law at tight tolerances.",
        draw=_switching_order,
        cost=5,
    ),
)
