"""True numbers of the tippedisk, with honest uncertainties.

The front door is `tippedisk_verify.disk`: a `Disk` and the questions it answers. The packages
behind it follow; each imports only from those before it:

- `tippedisk_verify.support`: files, cache, processes, progress: no mathematics;
- `tippedisk_verify.numbers`: exact inputs, arithmetics, numbers with half-widths;
- `tippedisk_verify.model`: the disk, its friction laws and equations of motion;
- `tippedisk_verify.proofs`: proved enclosures in ball arithmetic. It imports `model` only, and
  `tippedisk_verify.certify` supplies its starting numbers;
- `tippedisk_verify.theory`: results in closed form and series, and
  `tippedisk_verify.flow`: the integration of states. Neither imports the other, so their agreement
  is evidence;
- `tippedisk_verify.connection`: the speed at which the saddles connect;
- `tippedisk_verify.cycles`: limit cycles, at a speed or near Omega_h, their families and folds;
- `tippedisk_verify.omega_h`: Omega_h by four methods, and the study of its neighbourhood;
- `tippedisk_verify.motion`: solutions, scenes, basins;
- `tippedisk_verify.audit`: the paper's claims and the examination of each;
- `tippedisk_verify.reference_values`: reading, checking and redrawing the reference values, and
  `tippedisk_verify.conformance`: grading other programs by them;
- `tippedisk_verify.bench`: run time against error, `tippedisk_verify.stress`: numerically hard
  cases, and `tippedisk_verify.sweep`: tables of many disks, speeds or starts;
- `tippedisk_verify.figures` and `tippedisk_verify.report`: pictures and pages;
- `tippedisk_verify.commands`: the command line.

>>> import tippedisk_verify as tv
>>> disk = tv.Disk("table1")
>>> print(f"{disk.omega_crit:.16g}")
30.88659268864357
>>> disk.equilibrium("inverted", "30.4").stable
False
>>> sol = disk.integrate("30.4", ("pi/2", "pi/2 + 0.4", 0), 10)
>>> sol.message, sol.y.shape, bool(sol.uncertainty.max() < 1e-12)
('the final time was reached', (3, 201), True)
>>> print(f"{disk.limit_cycle('30.4').period:.9g}")
1.08255527
>>> print(tv.reference("table1/linear/limit-cycle/crit-0.5/v_0").values["doubles"][0][:20])
-1.71000216164390253
>>> tv.compare("table1/linear/hopf/point/omega_crit", 30.9).verdict
'wrong'

Importing the package loads nothing heavy: each name is imported on first use. The stub file
`__init__.pyi` lists the module of each name.
"""

from __future__ import annotations

__version__ = "1.1.0.dev0"

_homes: dict[str, str] = {}


def _home_of(name: str) -> str | None:
    """Return the module that defines a public name; None if the name is not public."""
    if not _homes:
        from ast import ImportFrom, parse
        from pathlib import Path

        stub = parse(Path(__file__).with_suffix(".pyi").read_text(encoding="utf-8"))
        imports = (node for node in stub.body if isinstance(node, ImportFrom))
        _homes.update((alias.name, str(node.module)) for node in imports for alias in node.names)
    return _homes.get(name)


def __getattr__(name: str) -> object:
    home = _home_of(name)
    if name == "__all__":
        return sorted(_homes)
    if home is None:
        raise AttributeError(f"module 'tippedisk_verify' has no attribute '{name}'")
    from importlib import import_module

    value = globals()[name] = getattr(import_module(home), name)
    return value


def __dir__() -> list[str]:
    _home_of("")  # reads the stub
    return [*_homes, *(name for name in globals() if name.startswith("__"))]
