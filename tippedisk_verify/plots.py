"""Figures. Matplotlib is imported here and nowhere else, and only when a figure is drawn."""

from __future__ import annotations

import io
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from tippedisk_verify.evidence.near_omega_h import Sight
from tippedisk_verify.evidence.switching_order import OrderPoint
from tippedisk_verify.files import write_bytes
from tippedisk_verify.model.measured import Measured
from tippedisk_verify.model.parameters import Parameters
from tippedisk_verify.model.precision import DOUBLE
from tippedisk_verify.orbits.basins import Basins
from tippedisk_verify.orbits.heteroclinic import Heteroclinic
from tippedisk_verify.orbits.periodic import LimitCycle
from tippedisk_verify.orbits.scenes import SCENES, Panel
from tippedisk_verify.theory.slow_manifold import slow_manifold

__all__ = [
    "draw_branch",
    "draw_eigenvalues",
    "draw_harmonic_balance",
    "draw_scenes_2d",
    "draw_scenes_3d",
    "pyplot",
    "save",
]

# Okabe and Ito's palette: told apart by readers with any colour vision, and of different lightness in grey.
_ORBITS = ("#0072B2", "#E69F00")
_STABLE, _UNSTABLE = "#D55E00", "#000000"
_ATTRACTOR = "#009E73"
_SURFACE = "#B0B0B0"
_DRAWN_SECONDS = 30.0
_STYLE: dict[Any, Any] = {
    "font.size": 9.0,
    "axes.titlesize": 9.5,
    "axes.linewidth": 0.6,
    "lines.solid_joinstyle": "round",
    "savefig.dpi": 160,
    "svg.hashsalt": "tippedisk",
    "figure.facecolor": "white",
}


def pyplot() -> Any:
    """Matplotlib's pyplot without a screen and in the house's style."""
    import matplotlib

    matplotlib.use("Agg", force=False)
    import matplotlib.pyplot as plt

    for key, value in _STYLE.items():
        plt.rcParams[key] = value
    return plt


def save(figure: Any, folder: Path, name: str) -> list[Path]:
    """Write ``name.png`` and ``name.svg`` into ``folder`` and close the figure; returns the paths."""
    written = []
    for kind in ("png", "svg"):
        stream = io.BytesIO()
        figure.savefig(stream, format=kind, metadata={"Date": None} if kind == "svg" else {})
        written.append(write_bytes(folder / f"{name}.{kind}", stream.getvalue()))
    pyplot().close(figure)
    return written


def _grid(panels: Sequence[Panel], size: tuple[float, float], **subplot: Any) -> tuple[Any, list[Any]]:
    plt = pyplot()
    columns = 1 if len(panels) == 1 else 2
    rows = math.ceil(len(panels) / columns)
    figure = plt.figure(figsize=(size[0] * columns, size[1] * rows), layout="constrained")
    return figure, [figure.add_subplot(rows, columns, index + 1, **subplot) for index in range(len(panels))]


def _drawn(panel: Panel) -> list[Any]:
    """The states of each orbit that are drawn; a panel's gamma range is what they cover, at most one turn each way."""
    return [orbit.states[orbit.times <= _DRAWN_SECONDS] for orbit in panel.orbits]


def _clipped(states: Any) -> Any:
    """The part within one well to either side: further wells repeat it, and would squeeze the picture."""
    import numpy

    far = numpy.flatnonzero(abs(states[:, 1] - math.pi / 2) > 1.6 * math.pi)
    return states[: far[0]] if len(far) else states


def _last_turn(panel: Panel) -> Any:
    """One period of the limit cycle, from the end of the orbit that has settled best; None elsewhere."""
    import numpy

    settled = [orbit for orbit in panel.orbits if orbit.ending.kind == "limit cycle"]
    if not settled:
        return None
    best = min(settled, key=lambda orbit: float(orbit.ending.amplitude.uncertainty) if orbit.ending.amplitude else 1.0)
    falling = numpy.flatnonzero((best.states[:-1, 0] > math.pi / 2) & (best.states[1:, 0] <= math.pi / 2))
    return best.states[falling[-2] : falling[-1] + 2] if len(falling) > 1 else None


def _equilibria(panel: Panel, gammas: Sequence[float]) -> list[tuple[float, bool]]:
    """(gamma, stable) of the equilibria whose gamma lies in the range drawn."""
    low, high = min(gammas), max(gammas)
    found = []
    for turn in range(-3, 4):
        for start, stable in ((math.pi / 2, panel.inverted_stable), (-math.pi / 2, panel.noninverted_stable)):
            gamma = start + 2 * math.pi * turn
            if low - 0.2 <= gamma <= high + 0.2:
                found.append((gamma, stable))
    return found


def _angle_axis(axis: Any, low: float, high: float) -> None:
    first, last = math.ceil(low / (math.pi / 2)), math.floor(high / (math.pi / 2))
    halves = [half for half in range(first, last + 1) if last - first <= 6 or half % 2]
    names = {0: "0", 1: "π/2", 2: "π", -1: "−π/2", -2: "−π"}
    labels = [names.get(half, f"{half // 2}π" if half % 2 == 0 else f"{half}π/2".replace("-", "−")) for half in halves]
    axis.set_ticks([half * math.pi / 2 for half in halves], labels)


def draw_scenes_2d(panels: Sequence[Panel]) -> Any:
    """The panels projected onto the (beta, gamma) plane (the paper's Figure proj_3D)."""
    figure, axes = _grid(panels, (4.6, 3.1))
    for panel, axis in zip(panels, axes, strict=True):
        gammas: list[float] = [-math.pi / 2, 3 * math.pi / 2]
        for states, colour in zip(map(_clipped, _drawn(panel)), _ORBITS, strict=True):
            axis.plot(states[:, 0], states[:, 1], color=colour, lw=0.7, zorder=2)
            axis.plot(states[0, 0], states[0, 1], "x", color="black", ms=6, mew=1.3, zorder=7)
            gammas += [float(states[:, 1].min()), float(states[:, 1].max())]
        cycle = _last_turn(panel)
        if cycle is not None:
            axis.plot(cycle[:, 0], cycle[:, 1], color=_ATTRACTOR, lw=2.0, zorder=3)
        for gamma, stable in _equilibria(panel, gammas):
            _equilibrium_mark(axis, (math.pi / 2,), (gamma,), stable)
        axis.set_title(panel.scene.title)
        axis.set_xlabel("β [rad]")
        axis.set_ylabel("γ [rad]")
        axis.set_xlim(0, math.pi)
        _angle_axis(axis.xaxis, 0, math.pi)
        _angle_axis(axis.yaxis, min(gammas), max(gammas))
        axis.grid(lw=0.3, alpha=0.5)
    _legend(figure)
    return figure


def _equilibrium_mark(axis: Any, x: Any, y: Any, stable: bool, **more: Any) -> None:
    axis.plot(
        x,
        y,
        *more.pop("z", ()),
        marker="o",
        ls="none",
        ms=6,
        mfc=_STABLE if stable else "white",
        mec=_STABLE if stable else _UNSTABLE,
        mew=1.4,
        zorder=6,
    )


def _legend(figure: Any, surface: bool = False) -> None:
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    def mark(**style: Any) -> Any:
        return Line2D([], [], **style)

    handles = [
        mark(color=_ORBITS[0], lw=1.2, label=r"orbit from $x_0^1 = (\pi/2, -\pi/2, 2)$"),
        mark(color=_ORBITS[1], lw=1.2, label=r"orbit from $x_0^2 = (\pi/2, \pi/2 + 0.4, 0)$"),
        mark(color=_ATTRACTOR, lw=2.0, label="limit cycle"),
        mark(color="black", marker="x", ls="none", mew=1.3, label="start"),
        mark(marker="o", ls="none", mfc=_STABLE, mec=_STABLE, label="stable equilibrium"),
        mark(marker="o", ls="none", mfc="white", mec=_UNSTABLE, mew=1.4, label="unstable equilibrium"),
    ]
    if surface:
        handles.append(Patch(facecolor=_SURFACE, alpha=0.6, label="slow manifold, order 1"))
        handles.append(mark(color="#606060", lw=0.7, label="critical manifold, order 0"))
    figure.legend(handles=handles, loc="outside lower center", ncols=3, frameon=False)


def draw_scenes_3d(panels: Sequence[Panel], parameters: Parameters) -> Any:
    """The panels in (beta, gamma, v) with the slow manifold of orders 0 and 1 (the paper's Figure 3D)."""
    import numpy

    figure, axes = _grid(panels, (4.6, 4.0), projection="3d", computed_zorder=False)
    constants = parameters.at(DOUBLE)
    for panel, axis in zip(panels, axes, strict=True):
        omega = float(panel.omega)
        orbits = [_clipped(states) for states in _drawn(panel)]
        low = min(-math.pi / 2, *(float(states[:, 1].min()) for states in orbits))
        high = max(3 * math.pi / 2, *(float(states[:, 1].max()) for states in orbits))
        reach = max(0.75, *(float(abs(states[:, 0] - math.pi / 2).max()) for states in orbits))
        # Close to sin(beta) = 0 the order-1 term diverges: the surface ends where it stops being an approximation.
        reach = min(reach + 0.05, 1.0)
        beta, gamma = numpy.meshgrid(
            numpy.linspace(math.pi / 2 - reach, math.pi / 2 + reach, 33), numpy.linspace(low, high, 65)
        )
        surface = slow_manifold(numpy, constants, omega, beta, gamma, order=1)
        rolling = slow_manifold(numpy, constants, omega, beta, gamma, order=0)
        sheet = axis.plot_surface(
            beta, gamma, surface, color=_SURFACE, alpha=0.45, lw=0, rstride=1, cstride=1, zorder=1
        )
        sheet.set_rasterized(True)  # thousands of facets: a vector file of them would be megabytes
        axis.plot_wireframe(beta, gamma, rolling, color="#606060", lw=0.3, alpha=0.6, rstride=8, cstride=8, zorder=1)
        for states, colour in zip(orbits, _ORBITS, strict=True):
            axis.plot(*states.T, color=colour, lw=0.8, zorder=3)
            axis.plot(*states[:1].T, marker="x", ls="none", color="black", ms=6, mew=1.3, zorder=5)
        cycle = _last_turn(panel)
        if cycle is not None:
            axis.plot(*cycle.T, color=_ATTRACTOR, lw=2.0, zorder=4)
        for place, stable in _equilibria(panel, (low, high)):
            _equilibrium_mark(axis, (math.pi / 2,), (place,), stable, z=((0.0,),))
        axis.set_title(panel.scene.title, pad=2)
        axis.set_xlabel("β [rad]", labelpad=2)
        axis.set_ylabel("γ [rad]", labelpad=4)
        axis.set_zlabel("dβ/dt [rad/s]", labelpad=1)
        axis.set_xticks([math.pi / 2 - 0.5, math.pi / 2, math.pi / 2 + 0.5], ["π/2−0.5", "π/2", "π/2+0.5"])
        _angle_axis(axis.yaxis, low, high)
        axis.tick_params(pad=0, labelsize=8)
        axis.view_init(elev=36, azim=-58)
        axis.set_box_aspect((1, 1.35, 0.8), zoom=1.04)
    _legend(figure, surface=True)
    return figure


def draw_eigenvalues(parameters: Parameters, omegas: Sequence[float]) -> tuple[Any, list[tuple[float, ...]]]:
    """Eigenvalues of inverted spinning against Omega (the paper's Figure bif_dia_3) and the rows that are drawn."""
    from tippedisk_verify.theory.equilibria import equilibrium
    from tippedisk_verify.theory.hopf import omega_crit

    rows = []
    for omega in omegas:
        found = equilibrium(parameters, omega, "inverted", 12).eigenvalues
        rows.append((omega, *(float(part) for value in found for part in (value.re, value.im))))
    figure, (left, right) = pyplot().subplots(1, 2, figsize=(9.2, 3.2), layout="constrained")
    crit = float(omega_crit(parameters))
    for column, (axis, name) in enumerate(((left, "Re λ [1/s]"), (right, "Im λ [1/s]"))):
        for pair, style in ((0, "-"), (1, "--")):
            axis.plot(omegas, [row[1 + 2 * pair + column] for row in rows], style, color=_ORBITS[pair], lw=1.4)
        axis.axvline(crit, color="black", lw=0.6)
        axis.axhline(0, color="black", lw=0.6)
        axis.set_xlabel("Ω [rad/s]")
        axis.set_ylabel(name)
        axis.grid(lw=0.3, alpha=0.5)
    left.set_title("inverted spinning: λ₁ (solid), λ₂ (dashed)")
    right.set_title(f"λ₃ is near −{abs(rows[0][5]):.0f} 1/s and not shown; line at Ω_crit")
    return figure, rows


def draw_harmonic_balance(parameters: Parameters, distances: Sequence[str]) -> tuple[Any, list[tuple[object, ...]]]:
    """Amplitude and period near Omega_crit: printed and consistent law against numerical harmonic balance.

    The paper's Figure HBM with the truth beside it. ``distances`` are Omega_crit - Omega [rad/s], rising. Speeds at
    which a law or the balance has no cycle are left out of its curve.
    """
    from fractions import Fraction

    from tippedisk_verify.errors import NoSuchCycleError, Shortfall
    from tippedisk_verify.theory.harmonic_balance import one_harmonic
    from tippedisk_verify.theory.hopf import omega_crit, period_crit
    from tippedisk_verify.theory.spectral_balance import balanced_cycle

    crit, birth = omega_crit(parameters, 40).value, float(period_crit(parameters))
    curves: dict[str, list[tuple[float, float, float]]] = {
        name: [(float(crit), 0.0, birth)] for name in ("printed", "consistent", "numerical")
    }
    for text in distances:
        speed = crit - Fraction(text)
        for form in ("printed", "consistent"):
            try:
                law = one_harmonic(parameters, speed, form)
            except Shortfall:
                continue
            curves[form].append((float(speed), float(law.amplitude), float(law.period)))
        try:
            cycle = balanced_cycle(parameters, speed, digits=8)
        except NoSuchCycleError:
            continue
        curves["numerical"].append((float(speed), float(cycle.beta_max), float(cycle.period)))
    figure, axes = pyplot().subplots(1, 2, figsize=(9.2, 3.4), layout="constrained")
    styles = {"printed": ("--", _ORBITS[1]), "consistent": ("-.", _ORBITS[0]), "numerical": ("-", _ATTRACTOR)}
    labels = {"printed": "law as printed", "consistent": "consistent law", "numerical": "numerical balance"}
    for column, (axis, name) in enumerate(zip(axes, ("β amplitude [rad]", "period T [s]"), strict=True), start=1):
        for key, points in curves.items():
            line, colour = styles[key]
            axis.plot(
                [p[0] for p in points], [p[column] for p in points], line, color=colour, lw=1.5, label=labels[key]
            )
        axis.plot(float(crit), 0 if column == 1 else birth, "o", color="black", ms=5)
        axis.set_xlabel("Ω [rad/s]")
        axis.set_ylabel(name)
        axis.grid(lw=0.3, alpha=0.5)
    axes[0].margins(y=0.08)
    axes[0].legend(frameon=False)
    return figure, [(key, *point) for key, points in curves.items() for point in points]


def draw_branch(
    parameters: Parameters, cycles: Sequence[LimitCycle], omega_h: Measured
) -> tuple[Any, list[tuple[float, ...]]]:
    """Amplitude, period and slow multiplier of the family against Omega (the paper's Figures Shooting and sketch).

    As in the paper's sketch, dots are inverted spinning at the six scenes' speeds and squares their limit cycles.
    """
    from fractions import Fraction

    import numpy

    from tippedisk_verify.errors import Shortfall
    from tippedisk_verify.theory.harmonic_balance import one_harmonic
    from tippedisk_verify.theory.hopf import omega_crit

    ordered = sorted(cycles, key=lambda cycle: cycle.omega.value)
    rows = [
        tuple(float(getattr(c, name)) for name in ("omega", "beta_max", "period", "multiplier_slow")) for c in ordered
    ]
    law = []
    for omega, *_ in rows:
        try:
            found = one_harmonic(parameters, Fraction(omega), "printed")
        except Shortfall:
            continue
        law.append((omega, float(found.amplitude), float(found.period)))
    figure, axes = pyplot().subplots(1, 3, figsize=(11.5, 3.3), layout="constrained")
    names = ("largest |β − π/2| [rad]", "period T [s]", "slow Floquet multiplier")
    for column, (axis, name) in enumerate(zip(axes, names, strict=True), start=1):
        axis.plot([r[0] for r in rows], [r[column] for r in rows], color=_ATTRACTOR, lw=1.6, label="shooting")
        if column < 3:
            axis.plot([r[0] for r in law], [r[column] for r in law], "--", color="black", lw=1.0, label="printed law")
        axis.set_xlabel("Ω [rad/s]")
        axis.set_ylabel(name)
        axis.grid(lw=0.3, alpha=0.5)
    crit = float(omega_crit(parameters))
    for scene in SCENES:
        omega = float(scene.omega(parameters, omega_h))
        fill = _ATTRACTOR if omega > crit else "white"
        axes[0].plot([omega], [0], "o", ms=5, mec=_ATTRACTOR, mfc=fill, clip_on=False, zorder=4)
        top = 0.0
        if rows[0][0] <= omega <= rows[-1][0]:
            top = float(numpy.interp(omega, [r[0] for r in rows], [r[1] for r in rows]))
            axes[0].plot([omega], [top], "s", ms=5, color=_ATTRACTOR, zorder=4)
        axes[0].annotate(scene.name, (omega, top), xytext=(4, 4), textcoords="offset points")
    axes[0].margins(y=0.08)
    axes[0].legend(frameon=False)
    return figure, rows


def draw_near_omega_h(sights: Sequence[Sight], connection: Heteroclinic) -> tuple[Any, list[tuple[Any, ...]]]:
    """Close to Omega_h: the period and what its law leaves, and what double precision loses."""
    rows = [
        (s.distance, s.period, s.remainder, s.period_error, s.state_error, s.expected_error)
        for s in sorted(sights, key=lambda sight: -sight.distance)
    ]
    distance = [row[0] for row in rows]
    unstable, slow, _ = (float(value) for value in connection.saddle_eigenvalues)
    figure, axes = pyplot().subplots(1, 3, figsize=(11.5, 3.5), layout="constrained")
    last = rows[-1]
    law = [last[1] - 2 / unstable * math.log(value / last[0]) for value in distance]
    axes[0].semilogx(distance, [row[1] for row in rows], "o", ms=4, color=_ATTRACTOR, label="limit cycles")
    axes[0].semilogx(distance, law, "--", color="black", lw=1.0, label="−(2/λᵤ) log(Ω − Ω_h) + c")
    axes[0].set_ylabel("period T [s]")
    falling = [(row[0], abs(row[2])) for row in rows[:-4] if row[0] < 0.1]
    power = -slow / unstable - 1
    through = falling[-1][1] / falling[-1][0] ** power
    axes[1].loglog([x for x, _ in falling], [y for _, y in falling], "o", ms=4, color=_ATTRACTOR, label="T − law")
    axes[1].loglog([x for x, _ in falling], [through * x**power for x, _ in falling], "--", color="black", lw=1.0,
                   label=f"power {power:.3f} = |λₛ|/λᵤ − 1")  # fmt: skip
    axes[1].set_ylabel("what the law leaves [s]")
    seen = [(row[0], max(row[3], 1e-17)) for row in rows if row[3] is not None]
    lost = [row[0] for row in rows if row[3] is None]
    axes[2].loglog([x for x, _ in seen], [y for _, y in seen], "o", ms=4, color=_ATTRACTOR, label="T in double")
    if lost:
        axes[2].loglog(lost, [1.0] * len(lost), "x", ms=6, color="black", label="double finds no cycle")
    axes[2].loglog(distance, [row[5] for row in rows], "--", color="black", lw=1.0, label="rounding of Ω alone")
    axes[2].set_ylabel("error of T [s]")
    for axis in axes:
        axis.set_xlabel("Ω − Ω_h [rad/s]")
        axis.grid(lw=0.3, alpha=0.5)
        axis.legend(frameon=False, fontsize=8)
    return figure, rows


def draw_basins(found: Basins) -> Any:
    """What the states of a plane of constant v end on."""
    from matplotlib.colors import ListedColormap
    from matplotlib.patches import Patch

    colours = ("#d9d9d9", _ATTRACTOR, "#cc79a7", "black")
    figure, axis = pyplot().subplots(figsize=(7.5, 4.4), layout="constrained")
    axis.imshow(
        found.outcome,
        origin="lower",
        extent=(-math.pi / 2, 3 * math.pi / 2, 0, math.pi),
        aspect="auto",
        interpolation="nearest",
        cmap=ListedColormap(list(colours)),
        vmin=-0.5,
        vmax=3.5,
    )
    shares = found.fractions()
    patches = [
        Patch(color=colour, label=f"{name}: {100 * share:.2f} ± {100 * error:.2f} %")
        for colour, (name, (share, error)) in zip(colours, shares.items(), strict=True)
    ]
    axis.legend(handles=patches, loc="upper center", bbox_to_anchor=(0.5, -0.14), ncols=2, frameon=False)
    axis.set_xlabel("γ [rad]")
    axis.set_ylabel("β [rad]")
    axis.set_title(
        f"Ω = {float(found.omega):.4f} rad/s, {found.friction} law, start at dβ/dt = {found.v:g} rad/s,"
        f" {found.duration:g} s",
        fontsize=10,
    )
    return figure


def draw_switching_order(points: Sequence[OrderPoint]) -> Any:
    """Error against tolerance, with and without switching the smooth law's branch."""
    figure, axes = pyplot().subplots(1, 2, figsize=(8.5, 3.4), layout="constrained", sharex=True, sharey=True)
    names = {"taylor": "taylor, switching its branch", "scipy-DOP853": "DOP853, not switching"}
    for axis, (method, title) in zip(axes, names.items(), strict=True):
        for law, style in (("linear", "o--"), ("smooth", "s-")):
            chosen = [point for point in points if point.method == method and point.friction == law]
            axis.loglog(
                [point.tolerance for point in chosen],
                [max(point.error, 1e-17) for point in chosen],
                style,
                ms=4,
                lw=1.0,
                color="black" if law == "linear" else _ATTRACTOR,
                label=f"{law} law",
            )
        axis.set_title(title, fontsize=10)
        axis.set_xlabel("tolerance")
        axis.grid(lw=0.3, alpha=0.5)
        axis.legend(frameon=False)
    axes[0].set_ylabel("error after 3 s")
    return figure
