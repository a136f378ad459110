"""The derivatives of results by the parameters of the disk and by the speed."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from tippedisk_verify.model.measured import Measured
from tippedisk_verify.model.parameters import Parameters
from tippedisk_verify.model.results import Printable, as_json, result_lines

__all__ = ["Sensitivity"]


@dataclass(frozen=True, repr=False)
class Sensitivity(Printable):
    """The partial derivatives of numbers by parameters, in SI units, with half-widths.

    ``sensitivity["period"]["mu"]`` is dT/dmu at fixed other parameters and fixed speed. The columns
    are r, e, m, A, B, g, mu and epsilon, and for a cycle also omega.
    """

    derivatives: Mapping[str, Mapping[str, Measured]]  #: by number, then by parameter
    parameters: Parameters  #: the disk, with the friction law

    def __getitem__(self, name: str) -> Mapping[str, Measured]:
        """Return the derivatives of one number, by parameter."""
        return self.derivatives[name]

    def to_dict(self) -> dict[str, Any]:
        """Return the derivatives as data for JSON: by number, then by parameter."""
        return {name: as_json(row) for name, row in self.derivatives.items()}

    def __str__(self) -> str:
        entries = {
            f"d({name})/d({symbol})": slope
            for name, row in self.to_dict().items()
            for symbol, slope in row.items()
        }
        return "\n".join([f"{self._title()}, in SI units", *result_lines(entries, "  ")])
