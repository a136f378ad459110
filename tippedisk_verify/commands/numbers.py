"""The commands that print numbers: equilibria, Hopf point, slow manifold, limit cycles."""

from __future__ import annotations

from itertools import chain
from typing import TYPE_CHECKING, Any, NamedTuple, get_args

import click

from tippedisk_verify.commands.common import Common, common_options, print_result, quantities_of, speed, speed_options
from tippedisk_verify.errors import InputError, NoSuchCycleError, Shortfall
from tippedisk_verify.model.results import result_lines

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from tippedisk_verify.cycles.folds import Fold
    from tippedisk_verify.cycles.limit_cycle import LimitCycle, RotatingCycle

__all__ = ["COMMANDS"]


@quantities_of("beta", "gamma", "v", "eigenvalues", "kind_changes")
@click.command()
@speed_options
@common_options
def equilibria(common: Common, omega: str | None, below_crit: str | None) -> int:
    """States, eigenvalues and stability of inverted and noninverted spinning."""
    from tippedisk_verify.theory.equilibria import EquilibriumName, equilibrium, kind_changes

    omega_value, result = speed(common, omega, below_crit), {}
    for name in get_args(EquilibriumName):
        changes = [change.to_dict() for change in kind_changes(common.parameters, name, common.digits)]
        found = equilibrium(common.parameters, omega_value, name, common.digits)
        result[name] = found.to_dict() | {"kind_changes": changes}
    print_result(common, result)
    return 0


@quantities_of(
    *("omega_crit", "period", "first_lyapunov_coefficient"),
    *("transversality", "quadratic_coefficient", "quartic_coefficient", "second_lyapunov_coefficient"),
    *("amplitude_squared_slope", "period_slope"),
    *("quadratic_coefficient_slope", "fold_amplitude_slope", "fold_speed_curvature"),
)
@click.command()
@click.option(
    "--bautin",
    metavar="P",
    help="Also the Bautin points, where the first Lyapunov coefficient vanishes, as P of A, B, m, r and e varies.",
)
@common_options
def hopf(common: Common, bautin: str | None) -> int:
    """The Hopf point: speed, period, first Lyapunov coefficient, amplitude and period laws."""
    from tippedisk_verify.theory.bautin import bautin_points
    from tippedisk_verify.theory.hopf import hopf_point

    common.parameters.refuse_smooth("the Hopf point's normal form is")
    entries = hopf_point(common.parameters, common.digits).to_dict()
    if bautin is None:
        print_result(common, entries)
        return 0
    points = [point.to_dict() for point in bautin_points(common.parameters, bautin, common.digits)]
    lines = list(result_lines(entries))
    if not points:
        lines.append(f"no Bautin point: no admissible {bautin} makes the first Lyapunov coefficient zero")
    for point in points:
        lines.append(f"Bautin point as {bautin} varies:")
        lines += result_lines({name: entry for name, entry in point.items() if name != "parameter"}, "  ")
    print_result(common, entries | {"bautin": points}, lines)
    return 0


@quantities_of(
    *("beta", "gamma", "h", "residual", "residual_slope"),
    *("best_order", "smallest_term", "reduced_omega_crit"),
)
@click.command("slow-manifold")
@click.option(
    "--order",
    type=int,
    required=True,
    metavar="N",
    help="Highest order in epsilon, 0 to 40. Above 5 it takes long: 8 some ten seconds, 12 half a minute.",
)
@click.option("--omega", metavar="X", help="The spinning speed [rad/s]; Omega_crit - 0.5 if not given.")
@click.option("--beta", default="1.2", show_default=True, metavar="X", help="Where h is taken [rad].")
@click.option("--gamma", default="0.3", show_default=True, metavar="X", help="Where h is taken [rad].")
@common_options
def slow_manifold(common: Common, order: int, omega: str | None, beta: str, gamma: str) -> int:
    """Orders of the slow manifold, their residuals, and the reduced flow."""
    from tippedisk_verify.theory.slow_manifold import analyse_slow_manifold

    omega_value = speed(common, omega, None if omega is not None else "0.5")
    result = analyse_slow_manifold(common.parameters, omega_value, order, common.digits, at=(beta, gamma))
    print_result(common, result.to_dict())
    return 0


class _Asked(NamedTuple):
    """Which cycle of a family is wanted: what was given."""

    omega: str | None
    below_crit: str | None
    above_het: str | None
    below_het: str | None
    unstable: bool
    at_fold: bool

    def refuse_unless_one(self, *names: str) -> None:
        """Raises InputError unless exactly one of these options is given, and --unstable only where it chooses."""
        if sum(getattr(self, name) not in (None, False) for name in names) != 1:
            *first, last = (f"--{name.replace('_', '-')}" for name in names)
            raise InputError(f"give the speed of the cycle with one of {', '.join(first)} and {last}")
        if self.unstable and self.omega is None and self.below_crit is None:
            raise InputError("--unstable goes with --omega or --below-crit")


@quantities_of(
    *("omega", "period", "gamma_bar_0", "v_0", "beta_max"),
    *("multiplier_slow", "log_multiplier_slow", "log_multiplier_fast", "trivial_multiplier_defect"),
    *("dperiod_domega", "dgamma_bar_0_domega", "dv_0_domega"),
    *("beta_bar_0", "beta_bar_top", "v_top", "dbeta_bar_top_domega", "dv_top_domega", "null_vector"),
)
@click.command()
@speed_options
@click.option("--above-het", metavar="D", help="Omega_h + D [rad/s], with D as small as 1e-100.")
@click.option("--rotating", is_flag=True, help="The cycle on which gamma grows by 2 pi a period.")
@click.option("--unstable", is_flag=True, help="The unstable one, where a stable one has the same speed.")
@click.option("--below-het", metavar="D", help="The rotating cycle at Omega_h - D [rad/s].")
@click.option("--at-fold", is_flag=True, help="Where two cycles of the family meet and end: each of its folds.")
@common_options
def orbit(common: Common, rotating: bool, **asked: Any) -> int:
    """One limit cycle by shooting: period, state, multipliers, sensitivities."""
    choice = _Asked(**asked)
    if choice.at_fold:
        return _at_fold(common, rotating, choice)
    print_result(common, (_rotating if rotating else _librating)(common, choice))
    return 0


def _at_fold(common: Common, rotating: bool, asked: _Asked) -> int:
    """The fold of the rotating cycles, or all of the librating ones' family as far as it is followed."""
    from tippedisk_verify.atlas.locator import locator
    from tippedisk_verify.cycles.folds import libration_folds, rotation_fold
    from tippedisk_verify.cycles.librating_family import LibratingFamily
    from tippedisk_verify.flow import default_engine

    asked.refuse_unless_one("omega", "below_crit", "below_het" if rotating else "above_het", "at_fold")
    parameters, engine, digits = common.parameters, default_engine(), common.digits
    if rotating:
        print_result(common, rotation_fold(locator(parameters, engine).rotations, digits=digits).to_dict())
        return 0
    try:
        family = LibratingFamily(parameters, engine)
    except NoSuchCycleError as fault:
        raise Shortfall(str(fault)) from None
    folds = [fold.to_dict() for fold in libration_folds(parameters, engine, digits=digits, family=family)]
    end = "Omega_h" if family.connected else f"an amplitude of pi at {family.limit:.7g} rad/s"
    said = [f"this disk's family of limit cycles about inverted spinning has no fold from Omega_crit to {end}"]
    for number, fold in enumerate(folds, 1):
        said += [] if number > 1 else [f"folds from Omega_crit to {end}:"]
        said += result_lines({str(number): fold})
    print_result(common, {"folds": folds, "followed_to": end}, said[1:] if folds else said)
    return 0


def _librating(common: Common, asked: _Asked) -> dict[str, object]:
    """A cycle about inverted spinning, as JSON."""
    from tippedisk_verify.atlas.cycles_at_speed import cycle_above, cycle_at
    from tippedisk_verify.flow import default_engine

    parameters, engine, digits = common.parameters, default_engine(), common.digits
    if asked.below_het is not None:
        raise InputError("--below-het belongs to --rotating")
    asked.refuse_unless_one("omega", "below_crit", "above_het", "at_fold")
    if asked.above_het is not None:
        return cycle_above(parameters, asked.above_het, engine, digits=digits).to_dict()
    value, stable = speed(common, asked.omega, asked.below_crit), False if asked.unstable else None
    return cycle_at(parameters, value, engine, digits=digits, stable=stable).to_dict()


def _rotating(common: Common, asked: _Asked) -> dict[str, object]:
    """A rotating cycle, as JSON."""
    from tippedisk_verify.atlas.cycles_at_speed import rotating_below, rotating_cycle
    from tippedisk_verify.flow import default_engine

    parameters, engine, digits = common.parameters, default_engine(), common.digits
    if asked.above_het is not None:
        raise InputError("--above-het leads to cycles that do not rotate: use --omega, --below-crit or --below-het")
    asked.refuse_unless_one("omega", "below_crit", "below_het", "at_fold")
    if asked.below_het is not None:
        return rotating_below(parameters, asked.below_het, engine, digits=digits).to_dict()
    value = speed(common, asked.omega, asked.below_crit)
    return rotating_cycle(parameters, value, engine, stable=not asked.unstable, digits=digits).to_dict()


@quantities_of("omega", "period", "beta_max", "multiplier_slow")
@click.command()
@click.option("--paper-sets", is_flag=True, help="The paper's sets A^in and A^de: 801 speeds.")
@click.option("--omegas", metavar="X,X,...", help="These speeds [rad/s], in this order.")
@click.option("--rotating", is_flag=True, help="The rotating cycles: stable ones, their fold, and unstable ones.")
@click.option(
    "--proved", is_flag=True, help="Replace the numbers of each cycle by proved enclosures, where these exist."
)
@click.option("--out", metavar="FILE.csv", help="Write the family there as CSV.")
@common_options
def branch(common: Common, paper_sets: bool, omegas: str | None, rotating: bool, proved: bool, out: str | None) -> int:
    """The family of limit cycles from Omega_crit towards Omega_h, through any folds, or of the rotating ones."""
    from tippedisk_verify.atlas import branch as families
    from tippedisk_verify.files import output_file
    from tippedisk_verify.flow import default_engine
    from tippedisk_verify.progress import watched
    from tippedisk_verify.report.tables import write_branch

    if common.digits > 12:
        raise InputError(f"a branch holds at most 12 digits, not {common.digits}: ask orbit for more at single speeds")
    if paper_sets and omegas is not None:
        raise InputError("give either --paper-sets or --omegas")
    if rotating and paper_sets:
        raise InputError("the paper's sets have no rotating cycles: leave out --paper-sets or --rotating")
    if proved:
        if rotating:
            raise InputError("rotating cycles are proved one by one: ask certify orbit --rotating")
        if out is not None:
            raise InputError("the CSV has measured half-widths: leave out --out, or take the enclosures from --json")
    target = None if out is None else output_file(out)
    engine = default_engine()
    speeds = None if omegas is None else omegas.split(",")
    family: Iterator[LimitCycle | RotatingCycle]
    if rotating:
        total = 2 * len(speeds) if speeds else families.DEFAULT_ROTATIONS
        family = families.rotating_branch(common.parameters, engine, speeds)
    else:
        total = 801 if paper_sets else len(speeds) if speeds else families.DEFAULT_COUNT
        family = families.family(common.parameters, engine, paper_sets=paper_sets, omegas=speeds)
    cycles: list[LimitCycle | RotatingCycle] = list(watched(family, "limit cycles", total, not common.quiet))
    if target is not None:
        write_branch(cycles, target)
    lines = (
        f"omega {float(cycle.omega):.12g} rad/s  period {float(cycle.period):.12g} s"
        f"  beta_max {float(cycle.beta_max):.12g} rad  multiplier_slow {float(cycle.multiplier_slow):.6g}"
        for cycle in cycles
    )
    orbits: list[dict[str, object]] = [cycle.to_dict() for cycle in cycles]
    if proved:
        from tippedisk_verify.commands.certify_branch import proofs_of
        from tippedisk_verify.cycles.limit_cycle import LimitCycle

        proofs = proofs_of(common, [c for c in cycles if isinstance(c, LimitCycle)], None)
        # What is not proved keeps its measured half-widths, and says so.
        orbits = [cycle | entries for cycle, (entries, _) in zip(orbits, proofs, strict=True)]
        lines = (
            f"{line}  {'proved' if entries['proved'] else 'half-widths measured, not proved'}"
            for line, (entries, _) in zip(list(lines), proofs, strict=True)
        )
    folds = _folds(common, rotating, total >= families.MANY and common.parameters.friction == "linear")
    told = (f"fold at {fold.omega:.12g} rad/s  period {fold.period:.12g} s" for fold in folds)
    entries: list[object] = [fold.to_dict() for fold in folds]
    turns: dict[str, object] = {"fold": entries[0]} if rotating else {"folds": entries}
    print_result(common, {"orbits": orbits} | turns, chain(lines, told))
    return 0


def _folds(common: Common, rotating: bool, in_lanes: bool) -> Sequence[Fold]:
    """The folds of the family; none where it is known at single speeds only. Lanes serve if they are compiled."""
    from tippedisk_verify.atlas.locator import locator
    from tippedisk_verify.cycles.family import in_batches
    from tippedisk_verify.cycles.folds import libration_folds, rotation_fold
    from tippedisk_verify.cycles.librating_family import LibratingFamily
    from tippedisk_verify.cycles.section import LIBRATING
    from tippedisk_verify.flow import default_engine, default_lanes

    parameters, engine, digits = common.parameters, default_engine(), common.digits
    if rotating:
        return [rotation_fold(locator(parameters, engine).rotations, digits=digits)]
    try:
        solve = in_batches(LIBRATING, parameters, default_lanes()) if in_lanes else None
        return libration_folds(parameters, engine, digits=digits, family=LibratingFamily(parameters, engine, solve))
    except (NoSuchCycleError, Shortfall):
        return []


@quantities_of("omega_h", "saddle_eigenvalues", "saddle_value", "splitting_derivative", "budget")
@click.command()
@click.option(
    "--method",
    default="manifolds",
    show_default=True,
    metavar="NAME",
    help="manifolds, limit-cycles, bisection or scipy.",
)
@click.option("--out", metavar="FILE.csv", help="Write samples of the connection there.")
@common_options
def heteroclinic(common: Common, method: str, out: str | None) -> int:
    """Omega_h, where the saddles are connected, by one of several roads."""
    from tippedisk_verify.connection.heteroclinic import heteroclinic as connection
    from tippedisk_verify.files import output_file, write_csv
    from tippedisk_verify.flow import default_engine

    target = None if out is None else output_file(out)
    engine = default_engine()
    connected = connection(common.parameters, engine, digits=common.digits, method=method)
    if target is not None:
        times, states = connected.orbit(engine=engine)
        rows = [list(row) for row in zip(times.tolist(), *states.tolist(), strict=True)]
        write_csv(target, ("t [s]", "beta [rad]", "gamma [rad]", "v [rad/s]"), rows)
    print_result(common, connected.to_dict())
    return 0


@quantities_of("omega", "harmonics", "period", "gamma_bar_0", "v_0", "beta_max")
@click.command("harmonic-balance")
@speed_options
@click.option("--harmonics", type=int, metavar="N", help="Number of odd harmonics; chosen for the digits if not given.")
@common_options
def harmonic_balance(common: Common, omega: str | None, below_crit: str | None, harmonics: int | None) -> int:
    """A limit cycle by harmonic balance of the full equations, without an integrator."""
    from tippedisk_verify.cycles.spectral import balanced_cycle

    common.parameters.refuse_smooth("harmonic balance is")
    omega_value = speed(common, omega, below_crit)
    cycle = balanced_cycle(common.parameters, omega_value, digits=common.digits, harmonics=harmonics)
    print_result(common, cycle.to_dict())
    return 0


COMMANDS = (equilibria, hopf, slow_manifold, orbit, branch, heteroclinic, harmonic_balance)
