"""Additions to the commands' help: sections, quantities, and examples that tests run.

The meaning of a quantity comes from the field of its class; the options are in the commands'
modules.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from importlib import import_module
from textwrap import wrap

import click

from tippedisk_verify.display import COORDINATES, QuantityMeaning, column_heading, quantities

__all__ = ["EXAMPLES", "Cli", "CommandGroup", "DefinedCommand", "load_quantities"]

#: Two examples of each command, the cheaper first. Their output files can be written in any folder.
EXAMPLES: dict[str, tuple[str, str]] = {
    "verify": ("--only omega_crit lambda_3", "--out report"),
    "scene": ("d", "b d --out figures"),
    "integrate": (
        "--omega 31 --state 1.5,2,0 --time 3 --events turn",
        "--omega 31 --state 1,2,0 --time 2 --out m.csv",
    ),
    "equilibria": ("--omega 30.4", "--below-crit 0.5 --digits 30"),
    "hopf": ("--digits 50", "--parameters calibrated"),
    "slow-manifold": ("--order 3", "--order 2 --omega 30.4 --beta 1.2 --gamma 0.3"),
    "orbit": ("--below-crit 0.5", "--rotating --omega 30.0388"),
    "harmonic-balance": ("--below-crit 0.5", "--omega 30.8 --digits 30"),
    "branch": ("--omegas 30.3,30.4,30.5", "--paper-sets --out branch.csv"),
    "basin": (
        "--omega 30.5 --margin pi/2+0.4,pi/2,0",
        "--below-crit 0.5 --count 2000 --out basins",
    ),
    "heteroclinic": ("", "--digits 20 --out connection.csv"),
    "reference": ("list table1/linear/hopf", "show table1/linear/hopf/point/omega_crit"),
    "reference check": ("--sample 0", "--sample 50 --seed 1"),
    "reference list": ("table1/linear/hopf", "calibrated/smooth/limit-cycle"),
    "reference export": (
        "table1/linear/hopf --out hopf.csv",
        "table1/linear/rhs --format c --out rhs.h",
    ),
    "reference show": (
        "table1/linear/hopf/point/omega_crit",
        "table1/linear/limit-cycle/crit-0.5/period",
    ),
    "conformance": ("questions sheet.csv --levels 1", "client octave"),
    "conformance questions": ("sheet.csv --set table1", "fresh.csv --states 5 --seed 7"),
    "conformance grade": ("answers.csv", "answers.csv --html grades.html"),
    "conformance run": ("--levels 1-3 -- ./your_program", "--out graded -- ./your_program"),
    "conformance compare": ("old.csv new.csv", "old.csv new.csv --from doubles"),
    "conformance client": ("python", "octave"),
    "conformance grader": ("octave", "javascript"),
    "conformance guide": ("", "--json"),
    "certify": ("equilibria --omega 30.4", "hopf --digits 30"),
    "certify equilibria": ("--omega 30.4", "--every-speed"),
    "certify hopf": ("--digits 30", "--parameters calibrated"),
    "certify orbit": ("--below-crit 0.5", "--omega 30.4 --certificate cycle.json"),
    "certify heteroclinic": ("--digits 10", "--certificate omega_h.json"),
    "certify branch": ("--to 0.5", "--certificate family.json"),
    "certify check": ("cycle.json", "omega_h.json --jobs 1"),
    "sweep": (
        "hopf --over mu=0.2,0.3,0.4 --out hopf.csv",
        "orbit --over below-crit=0.1:0.7:7 --out cycles.csv",
    ),
    "bench": ("--only cycle", "--out bench"),
    "stress": ("--list", "--quick"),
}
_CYCLES = ("cycles.limit_cycle", "Cycle", "LimitCycle", "RotatingCycle")
# The classes that a command prints: a module and names in it, or "" and names of coordinates.
_PRINTED: dict[str, tuple[tuple[str, ...], ...]] = {
    "integrate": (("", "beta", "gamma", "v"),),
    "equilibria": (("", "beta", "gamma", "v"), ("theory.equilibria", "Equilibrium")),
    "hopf": (("theory.hopf", "HopfPoint"),),
    "slow-manifold": (("", "beta", "gamma"), ("theory.slow_manifold", "SlowManifold")),
    "orbit": (_CYCLES, ("cycles.families.folds", "Fold")),
    "harmonic-balance": (("cycles.collocation.collocation_cycles", "CollocationCycle"),),
    "branch": (_CYCLES,),
    "basin": (("", "margin"),),
    "heteroclinic": (("omega_h.connecting_orbit", "Heteroclinic"),),
}


class DefinedCommand(click.Command):
    """A command whose help ends with the quantities that it prints, and examples."""

    def format_epilog(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the end of the command's help. Only this loads the classes of the quantities."""
        self.epilog = _explanation(ctx)
        super().format_epilog(ctx, formatter)


class CommandGroup(click.Group):
    """A group of commands whose help has the first paragraph of each command's, and ends with
    examples.
    """

    def format_epilog(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the end of the group's help: examples."""
        self.epilog = _explanation(ctx)
        super().format_epilog(ctx, formatter)

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the list of commands into the help text."""
        commands = [self.commands[name] for name in self.list_commands(ctx)]
        _write_commands(formatter, "Commands", commands)


class Cli(CommandGroup):
    """The program's command line: its commands in sections."""

    def __init__(
        self, *args: object, sections: Mapping[str, Sequence[click.Command]], **kwargs: object
    ) -> None:
        super().__init__(*args, **kwargs)  # type: ignore[arg-type]
        self.sections = sections
        for command in (command for members in sections.values() for command in members):
            self.add_command(command)

    def list_commands(self, ctx: click.Context) -> list[str]:
        """Return the names of all commands in the order of the help's sections."""
        return [str(command.name) for members in self.sections.values() for command in members]

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the list of commands into the help text, by section."""
        for title, members in self.sections.items():
            _write_commands(formatter, title, members)


def _write_commands(
    formatter: click.HelpFormatter, title: str, commands: Sequence[click.Command]
) -> None:
    with formatter.section(title):
        formatter.write_dl([(str(command.name), _sentence(command)) for command in commands])


def _explanation(ctx: click.Context) -> str:
    """Return the end of a command's help: the quantities that it prints, and examples."""
    words: list[str] = []
    while ctx.parent:
        words.insert(0, str(ctx.info_name))
        ctx = ctx.parent
    path = " ".join(words)
    return _paragraphs(_defined(path), _examples(path))


def _paragraphs(*parts: list[str]) -> str:
    """Join paragraphs into a help text in which click keeps the lines; leave out empty ones."""
    return "\n\n".join("\b\n" + "\n".join(lines) for lines in parts if lines)


def _sentence(command: click.Command) -> str:
    """Return the first paragraph of a command's help, on one line."""
    return " ".join((command.help or "").partition("\n\n")[0].split())


def _defined(path: str) -> list[str]:
    known: dict[str, QuantityMeaning] = {}
    for module, *names in _PRINTED.get(path, ()):
        for name in names:
            if module:
                meanings = quantities(getattr(import_module(f"tippedisk_verify.{module}"), name))
            else:
                meanings = {name: COORDINATES[name]}
            known |= {key: entry for key, entry in meanings.items() if key not in known}
    definitions = [f"{column_heading(name)}: {entry.meaning}" for name, entry in known.items()]
    lines = [
        line
        for definition in definitions
        for line in wrap(definition, 76, initial_indent="    ", subsequent_indent="        ")
    ]
    return ["Quantities (± is a half-width that contains the true value):", *lines] if lines else []


def load_quantities() -> None:
    """Load all classes whose numbers are printed, so that every name has its unit."""
    for module in {module for printed in _PRINTED.values() for module, *_ in printed if module}:
        import_module(f"tippedisk_verify.{module}")


def _examples(path: str) -> list[str]:
    lines = [f"  tippedisk-verify {path} {words}".rstrip() for words in EXAMPLES.get(path, ())]
    return ["Examples:", *lines] if lines else []
