"""The file for AUTO-07p: its right-hand side, its start and its constants are those of the
reference data.
"""

from __future__ import annotations

import re
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

import tippedisk_verify as tv
from tippedisk_verify.commands.conformance_sources import CLIENTS, FOLDER
from tippedisk_verify.conformance.sheet import question_row
from tippedisk_verify.reference_values.store import Store, load_store

TEXT = (FOLDER / CLIENTS["auto"]).read_text(encoding="utf-8")
FORTRAN = shutil.which("gfortran")
START = "table1/linear/limit-cycle/crit-0.5"
NAMES = ("Omega", "r", "e", "m", "A", "B", "g", "mu", "epsilon")
RATES = ("gamma_rate", "v_rate", "dv_rate_dbeta", "dv_rate_dgamma", "dv_rate_dv")
# Some fifty operations in doubles, whose sums cancel by a factor of a thousand at most.
ROUNDING = 1e-11
#: Calls the routines as AUTO does: the rates and the gradient of v' at each state read, then the
#: start and its end.
DRIVER = """
program driver
  implicit none
  double precision :: u(3), par(36), f(3), by_u(3, 3), by_par(3, 36)
  integer :: n, states, icp(1) = 1
  read (*, *) states
  do n = 1, states
    read (*, *) par(1:9), u
    call FUNC(3, u, icp, par, 1, f, by_u, by_par)
    write (*, '(5es25.16e3)') f(2:3), by_u(3, :)
  end do
  call STPNT(3, u, par, 0d0)
  write (*, '(5es25.16e3)') u, par(1), par(11)
  call STPNT(3, u, par, 1d0)
  write (*, '(5es25.16e3)') u, par(1), par(11)
end program driver
double precision function GETP(code, k, u)
  character(*) :: code
  integer :: k
  double precision :: u(*)
  GETP = 0
end function GETP
"""


def states(law: str) -> tuple[Store, list[dict[str, str]]]:
    """The questions about v' of the printed set."""
    store = load_store()
    asked = [q for q in store.matching(f"table1/{law}/rhs/") if q.name == "v_rate"]
    return store, [question_row(store, q) for q in asked]


def right(store: Store, row: dict[str, str]) -> list[float]:
    entry = row["id"].rsplit("/", 1)[0]
    common = entry.replace(f"/{row['friction']}/", "/both/")
    return [
        store[f"{common if name == 'gamma_rate' else entry}/{name}"].for_doubles for name in RATES
    ]


@pytest.mark.skipif(FORTRAN is None, reason="no gfortran on this machine")
@pytest.mark.parametrize("law", ["linear", "smooth"])
def test_what_auto_calls(law: str, tmp_path: Path) -> None:
    text = TEXT.replace(
        ".false.               ! the friction law",
        f".{str(law == 'smooth').lower()}. ! the friction law",
    )
    (tmp_path / "tippedisk.f90").write_text(text + DRIVER)
    subprocess.run(
        [FORTRAN, "-O1", "-std=f2008", "-o", "driver", "tippedisk.f90"], check=True, cwd=tmp_path
    )
    store, rows = states(law)
    told = "".join(
        " ".join(row[name] for name in (*NAMES, "beta", "gamma", "v")) + "\n" for row in rows
    )
    done = subprocess.run(
        ["./driver"],
        input=f"{len(rows)}\n{told}",
        check=True,
        cwd=tmp_path,
        text=True,
        capture_output=True,
    )
    *answers, first, last = np.array(
        [line.split() for line in done.stdout.splitlines()], dtype=float
    )
    np.testing.assert_allclose(answers, [right(store, row) for row in rows], rtol=ROUNDING)
    period, gamma_bar, v = (
        store[f"{START}/{name}"].for_doubles for name in ("period", "gamma_bar_0", "v_0")
    )
    assert first.tolist() == [
        np.pi / 2,
        np.pi / 2 + gamma_bar,
        v,
        float(store[f"{START}/period"].inputs["Omega"]),
        period,
    ]
    if law == "linear":
        # A fourth-order method with steps of 0.3 ms closes the reference cycle: (101 / s x 0.3
        # ms)^4 / 120 a step.
        assert np.abs(last - first).max() < 1e-7


def test_the_constants_are_cut_out_and_the_speeds_are_reference_speeds() -> None:
    constants = "\n".join(re.findall(r"^!c (.*)$", TEXT, re.MULTILINE))
    assert {"NDIM = 3", "IPS = 2", "JAC = 1"} <= set(re.split(r", |\n", constants))
    asked = {float(number) for number in re.findall(r"\d+\.\d{9,}", constants)}
    near = {
        float(q.inputs["Omega"])
        for q in tv.references("table1/linear/")
        if q.name == "period" and q.level in (7, 9)
    }
    assert len(asked) == 6
    assert asked <= near
    assert len(TEXT.splitlines()) <= 150
    assert max(map(len, TEXT.splitlines())) <= 120
