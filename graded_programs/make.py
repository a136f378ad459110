"""Graded sheets of our own runs: five SciPy methods, heyoka in double, and the C client.

    python -m graded_programs.make                  # all, in a checkout with a C compiler
    python -m graded_programs.make heyoka-double    # one program
    python -m graded_programs.make --table          # only the table in README.md

SciPy and heyoka answer trajectories and librating cycles of the printed set from doubles; the
client answers all questions. The grades by quantity are written as CSV, as `tippedisk-verify
conformance grade ANSWERS --csv graded_programs/NAME.csv` writes them for any program.
"""

from __future__ import annotations

import csv
import subprocess
import sys
import tempfile
from functools import partial
from pathlib import Path

import tippedisk_verify as tv
from graded_programs.scipy_program import answered
from tippedisk_verify.commands.conformance_sources import CLIENTS
from tippedisk_verify.commands.conformance_sources import FOLDER as SOURCES
from tippedisk_verify.conformance.sheet import questions, sheet_csv
from tippedisk_verify.reference_values.store import load_store
from tippedisk_verify.support.files import csv_text, write_text

HERE = Path(__file__).parent
KINDS = ("trajectory", "limit-cycle", "near-heteroclinic")
PREFIXES = tuple(f"table1/{law}/{kind}/" for law in ("linear", "smooth") for kind in KINDS)
SCIPY = (("RK45", 1e-9), ("DOP853", 1e-12), ("LSODA", 1e-12), ("Radau", 1e-8), ("BDF", 1e-8))
_MARK = "<!-- made by graded_programs/make.py -->"


def heyoka() -> dict[str, str]:
    """Return the answers of heyoka's Taylor integrator in double, as this package uses it.

    The inputs are the doubles nearest to the decimals.
    """
    given: dict[str, str] = {}
    for law in ("linear", "smooth"):
        disk = tv.Disk(
            **{n: float(v) for n, v in tv.PRINTED.decimals().items() if n != "C"}, friction=law
        )
        entries: dict[str, list[tv.Measured]] = {}
        for kind in KINDS:
            for quantity in tv.references(f"table1/{law}/{kind}/", reading="doubles"):
                entries.setdefault(quantity.id.rsplit("/", 1)[0], []).append(quantity)
        for entry, asked in entries.items():
            numbers = (
                _motion(disk, asked[0].inputs)
                if "/trajectory/" in entry
                else _cycle(disk, asked[0].inputs)
            )
            given |= {q.id: repr(numbers[q.name]) for q in asked if q.name in numbers}
    return given


def _motion(disk: tv.Disk, inputs: dict[str, str]) -> dict[str, float]:
    from tippedisk_verify.flow.contract import SECTION

    start = [float(inputs[name]) for name in ("beta", "gamma", "v")]
    times = [n / 2 for n in range(21)]
    crossing = tv.Event("crossing", SECTION.function, terminal=False)
    run = disk.integrate(float(inputs["Omega"]), start, 10, t_eval=times, events=(crossing,))
    numbers = {
        f"{name}@{time:g}": float(value)
        for name, row in zip(("beta", "gamma", "v"), run.y, strict=True)
        for time, value in zip(run.t, row, strict=True)
    }
    crossings = [record for record in run.events if record.time > 0.01]
    for n, record in enumerate(crossings, start=1):
        numbers |= {
            f"crossing_time#{n}": float(record.time),
            f"crossing_gamma#{n}": float(record.state[1]),
            f"crossing_v#{n}": float(record.state[2]),
        }
    return numbers | ({"flat_time": float(run.end.time)} if run.status is tv.Status.FLAT else {})


def _cycle(disk: tv.Disk, inputs: dict[str, str]) -> dict[str, float]:
    cycle = disk.limit_cycle(float(inputs["Omega"]))
    names = [quantity.name for quantity in tv.references("table1/linear/limit-cycle/crit-0.5/")]
    return {name: float(getattr(cycle, name)) for name in names}


def _scipy(method: str, tolerance: float) -> dict[str, str]:
    return answered(load_store(), PREFIXES, method, tolerance)


def _client(*commands: list[str]) -> dict[str, str]:
    """Run a client on the sheet of the printed set, and return its answers.

    The commands run in a folder with the sheet; the last of them is the client.
    """
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        write_text(
            folder / "sheet.csv", sheet_csv(load_store(), questions(load_store(), sets=("table1",)))
        )
        for command in commands:
            subprocess.run(command, check=True, cwd=folder)
        rows = csv.DictReader((folder / "answers.csv").read_text(encoding="utf-8").splitlines())
        return {row["id"]: row["answer"] for row in rows if row["answer"]}


_RUN = ["./client", "sheet.csv", "answers.csv"]
PROGRAMS = {
    f"scipy-{method}-{tolerance:.0e}".replace("e-0", "e-"): partial(_scipy, method, tolerance)
    for method, tolerance in SCIPY
} | {
    "heyoka-double": heyoka,
    "client-c": lambda: _client(
        ["cc", "-O2", "-o", "client", str(SOURCES / CLIENTS["c"]), "-lm"], _RUN
    ),
}


def table() -> str:
    """Return the table of all graded files: failures and the worst digits of each level."""
    rows: dict[str, dict[int, list[dict[str, str]]]] = {}
    for path in sorted(HERE.glob("*.csv")):
        for row in csv.DictReader(path.read_text(encoding="utf-8").splitlines()):
            rows.setdefault(path.stem, {}).setdefault(int(row["level"]), []).append(row)
    levels = sorted({level for by_level in rows.values() for level in by_level})
    lines = [
        f"| program | {' | '.join(f'level {level}' for level in levels)} |",
        "|---" * (len(levels) + 1) + "|",
    ]
    for name, by_level in rows.items():
        lines.append(
            f"| `{name}` | {' | '.join(_cell(by_level.get(level, [])) for level in levels)} |"
        )
    return "\n".join(lines)


def _cell(rows: list[dict[str, str]]) -> str:
    if not rows:
        return ""
    failed, asked = (sum(int(row[name]) for row in rows) for name in ("failed", "answered"))
    least = min((float(row["least_digits"]) for row in rows if row["least_digits"]), default=0.0)
    return f"{failed} of {asked} fail, least {least:.1f} digits"


def main(names: list[str]) -> None:
    """Grade the named programs and update the table in README.md.

    Args:
        names: Names of `PROGRAMS`; none for all programs, ``--table`` for the table only.
    """
    for name in () if names == ["--table"] else names or PROGRAMS:
        given = PROGRAMS[name]()
        with tempfile.TemporaryDirectory() as folder:
            rows = ((id_, "doubles", answer) for id_, answer in given.items())
            sheet = write_text(
                Path(folder) / f"{name}.csv", csv_text(("id", "from", "answer"), rows)
            )
            command = [
                "conformance",
                "grade",
                str(sheet),
                "--csv",
                str(HERE / f"{name}.csv"),
                "--quiet",
            ]
            subprocess.run([sys.executable, "-m", "tippedisk_verify", *command], check=True)
        print(name, len(given), flush=True)
    before, _, after = (HERE / "README.md").read_text(encoding="utf-8").split(_MARK)
    write_text(HERE / "README.md", f"{before}{_MARK}\n{table()}\n{_MARK}{after}")


if __name__ == "__main__":
    main(sys.argv[1:])
