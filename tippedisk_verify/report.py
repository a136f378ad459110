"""What the main job writes: results.json, report.md, figures and CSV data. Each file is whole or absent."""

from __future__ import annotations

import json
import platform
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

from tippedisk_verify.errors import InputError, Shortfall
from tippedisk_verify.evidence.bench.race import Score
from tippedisk_verify.evidence.claims import Audit, Claim, Finding, Verdict
from tippedisk_verify.files import write_csv, write_text
from tippedisk_verify.model.measured import Measured
from tippedisk_verify.model.parameters import Parameters
from tippedisk_verify.model.precision import DOUBLE
from tippedisk_verify.orbits.basins import Basins
from tippedisk_verify.orbits.periodic import LimitCycle
from tippedisk_verify.orbits.scenes import Panel
from tippedisk_verify.theory.hopf import omega_crit
from tippedisk_verify.theory.slow_manifold import slow_manifold

__all__ = [
    "branch_entry",
    "claim_json",
    "results_json",
    "shown",
    "summary",
    "write_bench",
    "write_branch",
    "write_report",
    "write_scene_data",
]

_CSV_SECONDS = 60.0
_CSV_EVERY = 2  # of the 100 samples a second


def shown(value: Measured | str) -> str:
    """A computed value as a table cell: at most twelve decimals' worth of a number."""
    if isinstance(value, str):
        return value
    text, width = value.decimals()
    return text if width == "0" else f"{float(text):.12g}"


def claim_json(claim: Claim, finding: Finding, audit: Audit) -> dict[str, Any]:
    """One entry of ``claims`` in the promised shape, with the value for every audited set beside it."""

    def entry(value: Measured | str) -> Any:
        return value if isinstance(value, str) else value.json()

    computed = finding.computed.get(audit.parameters.name)
    return {
        "name": claim.name,
        "source": claim.source,
        "statement": claim.statement,
        "printed": claim.printed,
        "computed": None if computed is None else entry(computed),
        "computed_by_set": {name: entry(value) for name, value in finding.computed.items()},
        "verdict": finding.verdict.value,
        "sets": list(finding.sets),
        "note": finding.note,
        "methods": list(finding.methods),
        "own_check": claim.own_check,
    }


def summary(findings: Sequence[tuple[Claim, Finding]]) -> dict[str, Any]:
    """How many claims met each verdict, and which of our own checks fell short."""
    counts = {verdict.value: 0 for verdict in Verdict}
    for _, finding in findings:
        counts[finding.verdict.value] += 1
    failed = [claim.name for claim, finding in findings if claim.own_check and finding.verdict is not Verdict.HOLDS]
    return {"claims": len(findings), **counts, "own_checks_failed": failed}


def results_json(audit: Audit, findings: Sequence[tuple[Claim, Finding]]) -> dict[str, Any]:
    """The main job's JSON object."""
    return {
        "claims": [claim_json(claim, finding, audit) for claim, finding in findings],
        "summary": summary(findings),
        "parameters": {"name": audit.parameters.name, **audit.parameters.decimals()},
        "friction": audit.friction,
        "provenance": _provenance(),
    }


def _provenance() -> dict[str, str]:
    from importlib.metadata import PackageNotFoundError, version

    from tippedisk_verify import __version__

    def installed(package: str) -> str:
        try:
            return version(package)
        except PackageNotFoundError:  # pragma: no cover - every one of them is a dependency
            return "unknown"

    return {
        "tippedisk-verify": __version__,
        "python": platform.python_version(),
        "machine": platform.machine(),
        **{package: installed(package) for package in ("heyoka", "numpy", "scipy", "mpmath", "matplotlib")},
    }


def write_report(
    folder: Path, audit: Audit, findings: Sequence[tuple[Claim, Finding]], panels: Sequence[Panel]
) -> dict[str, Any]:
    """Everything into ``folder``; returns what went into results.json."""
    results = results_json(audit, findings)
    if panels:
        from tippedisk_verify.plots import draw_scenes_2d, draw_scenes_3d, save

        save(draw_scenes_3d(panels, audit.parameters), folder, "scenes_3d")
        save(draw_scenes_2d(panels), folder, "scenes_2d")
        for panel in panels:
            write_scene_data(folder, panel, audit.parameters)
        results["scenes"] = {panel.scene.name: panel.json() for panel in panels}
    names = {claim.name for claim, _ in findings}
    figures = ["scenes_3d", "scenes_2d"] if panels else []
    if "lambda_3" in names:
        figures.append(_write_eigenvalues(folder, audit.parameters))
    if "amplitude_law" in names and audit.friction == "linear":
        figures.append(_write_harmonic_balance(folder, audit.parameters))
    if "stable_branch" in names:
        with suppress(InputError, Shortfall):  # the claim's note says why there is no family
            figures.append(_write_branch(folder, audit))
    if "infinite_period" in names and audit.friction == "linear":
        with suppress(InputError, Shortfall):
            figures.append(_write_near_omega_h(folder, audit))
    if "smooth_same_behaviour" in names:
        figures.append(_write_switching_order(folder, audit.parameters))
    write_text(folder / "results.json", json.dumps(results, indent=1, ensure_ascii=False) + "\n")
    write_csv(
        folder / "claims.csv",
        ("name", "source", "printed", "verdict", "sets", *audit.sets, "note"),
        [
            (
                claim.name,
                claim.source,
                claim.printed,
                finding.verdict.value,
                " ".join(finding.sets),
                *(str(finding.computed.get(name, "")) for name in audit.sets),
                finding.note,
            )
            for claim, finding in findings
        ],
    )
    write_text(folder / "report.md", _markdown(audit, findings, figures, results))
    return results


def _write_eigenvalues(folder: Path, parameters: Parameters) -> str:
    from tippedisk_verify.plots import draw_eigenvalues, save

    crit = float(omega_crit(parameters))
    figure, rows = draw_eigenvalues(parameters, [crit * step / 40 for step in range(1, 81)])
    save(figure, folder, "eigenvalues")
    header = ("Omega [rad/s]", *(f"{part} lambda_{n} [1/s]" for n in (1, 2, 3) for part in ("Re", "Im")))
    write_csv(folder / "eigenvalues.csv", header, rows)
    return "eigenvalues"


def _write_harmonic_balance(folder: Path, parameters: Parameters) -> str:
    from tippedisk_verify.plots import draw_harmonic_balance, save

    distances = (
        "1e-3",
        "0.01",
        "0.03",
        "0.07",
        "0.12",
        "0.2",
        "0.3",
        "0.4",
        "0.5",
        "0.6",
        "0.7",
        "0.76",
        "0.8",
        "0.82",
    )
    figure, rows = draw_harmonic_balance(parameters, distances)
    save(figure, folder, "harmonic_balance")
    write_csv(folder / "harmonic_balance.csv", ("curve", "Omega [rad/s]", "beta_max [rad]", "T [s]"), rows)
    return "harmonic_balance"


def _write_branch(folder: Path, audit: Audit) -> str:
    from tippedisk_verify.plots import draw_branch, save

    figure, rows = draw_branch(audit.parameters, audit.family(name := audit.parameters.name), audit.omega_h(name))
    save(figure, folder, "branch")
    header = ("Omega [rad/s]", "beta_max [rad]", "T [s]", "slow multiplier")
    write_csv(folder / "branch.csv", header, rows)
    return "branch"


def _write_near_omega_h(folder: Path, audit: Audit) -> str:
    from tippedisk_verify.evidence.near_omega_h import near_omega_h
    from tippedisk_verify.plots import draw_near_omega_h, save

    connection, sights = near_omega_h(audit.parameters, audit.engine)
    figure, rows = draw_near_omega_h(sights, connection)
    save(figure, folder, "near_omega_h")
    header = (
        "Omega - Omega_h [rad/s]",
        "T [s]",
        "T - law [s]",
        "error of T in double [s]",
        "relative error of pi - gamma_bar_0 in double",
        "error of T from rounding Omega [s]",
    )
    write_csv(folder / "near_omega_h.csv", header, [["" if cell is None else cell for cell in row] for row in rows])
    return "near_omega_h"


def _write_switching_order(folder: Path, parameters: Parameters) -> str:
    from tippedisk_verify.evidence.switching_order import switching_order
    from tippedisk_verify.plots import draw_switching_order, save

    points = switching_order(parameters)
    save(draw_switching_order(points), folder, "switching_order")
    rows = [(point.method, point.friction, point.tolerance, point.error) for point in points]
    write_csv(folder / "switching_order.csv", ("method", "friction law", "tolerance", "error [rad, rad/s]"), rows)
    return "switching_order"


def write_scene_data(folder: Path, panel: Panel, parameters: Parameters) -> None:
    """``scene_X_orbit_N.csv`` for each orbit and ``scene_X_slow_manifold.csv`` for the surface."""
    import math

    import numpy

    for index, orbit in enumerate(panel.orbits, start=1):
        drawn = (orbit.times <= _CSV_SECONDS).nonzero()[0][::_CSV_EVERY]
        rows = numpy.column_stack((orbit.times[drawn], orbit.states[drawn])).tolist()
        header = ("t [s]", "beta [rad]", "gamma [rad]", "v [rad/s]")
        write_csv(folder / f"scene_{panel.scene.name}_orbit_{index}.csv", header, rows)
    constants, omega = parameters.at(DOUBLE), float(panel.omega)
    beta, gamma = numpy.meshgrid(
        numpy.linspace(math.pi / 2 - 1, math.pi / 2 + 1, 33), numpy.linspace(-math.pi / 2, 3 * math.pi / 2, 65)
    )
    surfaces = [slow_manifold(numpy, constants, omega, beta, gamma, order=order).ravel() for order in (0, 1)]
    rows = numpy.column_stack((beta.ravel(), gamma.ravel(), *surfaces)).tolist()
    header = ("beta [rad]", "gamma [rad]", "v at order 0 [rad/s]", "v at order 1 [rad/s]")
    write_csv(folder / f"scene_{panel.scene.name}_slow_manifold.csv", header, rows)


def _markdown(
    audit: Audit, findings: Sequence[tuple[Claim, Finding]], figures: Sequence[str], results: dict[str, Any]
) -> str:
    counts = results["summary"]
    lines = [
        "# The tippedisk's claims, audited",
        "",
        f"Parameter set *{audit.parameters.name}*, {audit.friction} friction law."
        f" {counts['claims']} claims: {counts['holds']} hold, {counts['holds-for']} hold for some parameter sets,"
        f" {counts['does-not-follow']} do not follow, {counts['undecided']} are undecided."
        + (
            f" **Own checks that fell short: {', '.join(counts['own_checks_failed'])}.**"
            if counts["own_checks_failed"]
            else ""
        ),
        "",
        "| claim | source | paper | " + " | ".join(audit.sets) + " | verdict |",
        "|---" * (4 + len(audit.sets)) + "|",
    ]
    for claim, finding in findings:
        cells = [shown(finding.computed[name]) if name in finding.computed else "" for name in audit.sets]
        verdict = finding.verdict.value
        if finding.verdict is Verdict.HOLDS_FOR:
            verdict += ": " + ", ".join(finding.sets)
        row = (claim.name, claim.source, claim.printed, *cells, verdict)
        lines.append("| " + " | ".join(cell.replace("|", "\\|") for cell in row) + " |")
    lines += ["", "## Each claim", ""]
    for claim, finding in findings:
        note = f" ({finding.note}.)" if finding.note else ""
        lines.append(
            f"- **{claim.name}**: {claim.statement}. *{finding.verdict.value}*{note}"
            f" Recompute: `tippedisk-verify verify --only {claim.name}`"
        )
    captions = {
        "scenes_3d": "Orbits and slow manifold in state space",
        "scenes_2d": "The same orbits, projected onto beta and gamma",
        "eigenvalues": "Eigenvalues of inverted spinning against the spinning speed",
        "branch": "The family of limit cycles",
        "switching_order": "Error against tolerance of both friction laws, with and without switching branches",
        "near_omega_h": "Close to Omega_h: the period's law, what it leaves, and what double precision loses",
        "harmonic_balance": "One-harmonic laws against numerical harmonic balance",
    }
    if figures:
        lines += ["", "## Figures", ""]
        lines += [f"![{captions[name]}]({name}.png)\n" for name in figures]
        lines += [
            "Beside this file: a CSV file with what each figure draws, `results.json` with every number and its"
            " uncertainty, `claims.csv` with the table above.",
        ]
    lines += ["", "Computed with " + ", ".join(f"{k} {v}" for k, v in results["provenance"].items()) + ".", ""]
    return "\n".join(lines)


def write_basins(found: Basins, folder: Path) -> None:
    """``basins.csv``: every initial state and what it ended on."""
    from tippedisk_verify.orbits.basins import OUTCOMES

    cells = zip(found.beta.ravel().tolist(), found.gamma.ravel().tolist(), found.outcome.ravel().tolist(), strict=True)
    rows = [(beta, gamma, found.v, OUTCOMES[outcome]) for beta, gamma, outcome in cells]
    write_csv(folder / "basins.csv", ("beta [rad]", "gamma [rad]", "v [rad/s]", "ends on"), rows)


def branch_entry(cycle: LimitCycle) -> dict[str, object]:
    """One orbit as JSON, without the history of its iteration."""
    found = cycle.json()
    del found["residuals"]
    return found


def write_branch(cycles: Sequence[LimitCycle], path: Path) -> None:
    """The family as CSV: for each number its value and its half-width."""
    names = [name for name, value in vars(cycles[0]).items() if isinstance(value, Measured)]
    header = [part for name in names for part in (name, f"{name} uncertainty")]
    rows = [[*(part for name in names for part in getattr(cycle, name).decimals()), cycle.stable] for cycle in cycles]
    write_csv(path, [*header, "stable"], rows)


def write_bench(folder: Path, scores: Sequence[Score], result: dict[str, Any]) -> None:
    """`bench.json` with everything, `bench.csv` and the figure with the initial-value problems."""
    from tippedisk_verify.bench_figure import draw_bench
    from tippedisk_verify.plots import save

    write_text(folder / "bench.json", json.dumps(result, indent=1) + "\n")
    if scores:
        rows = [score.json() for score in scores]
        write_csv(folder / "bench.csv", list(rows[0]), [list(row.values()) for row in rows])
        save(draw_bench(scores), folder, "bench")
