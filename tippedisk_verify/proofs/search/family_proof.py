"""The proof of the family of limit cycles: its answer for the command line, and its certificate.

`kernel.certificates.family` explains why arcs that fit together are one curve from the Hopf point
on, and what joins it to the cycles next to the connection.

All numbers stay balls here: none is replaced by its midpoint or a float.
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from typing import Any

from tippedisk_verify.model.parameters import Parameters
from tippedisk_verify.numbers.decimals import exact_text, round_down
from tippedisk_verify.numbers.measured import Measured
from tippedisk_verify.proofs.closed_forms import check_linearization, measured_omega_crit
from tippedisk_verify.proofs.kernel.balls import working_precision
from tippedisk_verify.proofs.kernel.certificates import cycles_near_omega_h, sentence
from tippedisk_verify.proofs.kernel.certificates.family import (
    ArcStatus,
    ProvedArc,
    curve_fault,
    last_cycle,
    unique_within,
)
from tippedisk_verify.proofs.search.arc_evidence import arc_entry
from tippedisk_verify.proofs.search.connection_proof import ConnectionProof
from tippedisk_verify.proofs.search.cycles_near_omega_h_proof import CyclesNearOmegaHProof
from tippedisk_verify.proofs.search.proof_search import Proof, certificate_claim, parameter_texts

__all__ = ["FamilyProof"]

# For joining arcs, and for checking a claim about Omega_crit, which has as many digits
_JOINING_BITS, _CLAIM_BITS = 128, 160
_DECIMALS = 9  # of the share and of the speed at the end, rounded to the safe side


@dataclass(frozen=True, repr=False)
class FamilyProof(Proof):
    """The proof of the family of limit cycles between Omega_h and Omega_crit, as far as it
    succeeded.

    ``arcs`` are proved parts of the family that form one curve from the Hopf point on. There may
    be none.
    """

    parameters: Parameters
    arcs: tuple[ProvedArc, ...]
    #: The reason why the arc after the last one is not proved, if one was tried
    stop_reason: ArcStatus | None = None
    connection: ConnectionProof | None = None  #: Omega_h, if it is known
    near_omega_h: CyclesNearOmegaHProof | None = (
        None  #: the cycles next to the connection, if they are proved
    )

    @cached_property
    def hopf_closed(self) -> bool:
        """True if the arcs of the family are proved to form one curve that begins at the Hopf
        point.

        Raises InputError for a disk without the closed forms' hypotheses.
        """
        check_linearization(self.parameters.rational_constants())
        with working_precision(_JOINING_BITS):
            return not curve_fault(parameter_texts(self.parameters), self.arcs)

    @cached_property
    def heteroclinic_closed(self) -> bool:
        """True if the last arc of the family runs into the limit cycles that are proved next to
        the heteroclinic connection.
        """
        if (
            self.near_omega_h is None
            or not self.arcs
            or self.near_omega_h.connection.parameters != self.parameters
        ):
            return False
        with working_precision(_JOINING_BITS):
            return self.near_omega_h.contains_cycle(*last_cycle(self.arcs))

    @property
    def proved(self) -> bool:
        """True if the theorem is proved for all speeds between Omega_h and Omega_crit."""
        return self.hopf_closed and self.heteroclinic_closed

    @property
    def omega_end(self) -> Fraction | None:
        """The lowest speed [rad/s], rounded up, to which the proved curve of limit cycles reaches.

        All speeds from there up to Omega_crit belong to the curve. None if no curve is proved from
        the Hopf point on.
        """
        if not self.hopf_closed:
            return None
        unit = 10**_DECIMALS
        return Fraction(-(-self.arcs[-1].speeds(self.arcs[-1].high)[1] * unit // 1), unit)

    @property
    def covered(self) -> Fraction | None:
        """A lower bound of the share of the speeds between Omega_h and Omega_crit at which a limit
        cycle is proved.

        It is 1 if the whole family is proved. It is None if Omega_h is not proved, or if no curve
        is proved from the Hopf point on.
        """
        if self.proved:
            return Fraction(1)
        known = (
            self.connection.omega_h
            if self.connection is not None and self.connection.proved
            else None
        )
        if self.omega_end is None or known is None:
            return None
        # It grows with Omega_crit and with Omega_h.
        top, bottom = (
            number.value - number.uncertainty
            for number in (measured_omega_crit(self.parameters), known)
        )
        unit = 10**_DECIMALS
        return Fraction(max(Fraction(0), (top - self.omega_end) / (top - bottom)) * unit // 1, unit)

    @property
    def claim(self) -> dict[str, Any]:
        """The claim of the certificate about the family of limit cycles, as a dictionary.

        It has the disk, the numbers, the amplitudes and speed that the curve reaches, and distances
        within which its cycles are unique.
        """
        names = ("v_0_per_gamma_bar_0", "v_0", "omega")
        claim = certificate_claim(
            "family of limit cycles",
            self.parameters,
            {"omega_crit": measured_omega_crit(self.parameters)},
            amplitude_first=self.arcs[0].high,
            amplitude_end=self.arcs[-1].high,
            omega_end=self.omega_end,
            unique_within=dict(zip(names, map(round_down, unique_within(self.arcs)), strict=True)),
        )
        if self.near_omega_h is not None and self.heteroclinic_closed:
            claim["numbers"] |= (end := self.near_omega_h.claim)["numbers"]
            claim |= {name: end[name] for name in cycles_near_omega_h.CLAIM_SHAPE} | {
                "kind": "whole family of limit cycles"
            }
        return claim

    @property
    def bits(self) -> int:  # type: ignore[override]
        return (
            max(_CLAIM_BITS, self.near_omega_h.bits)
            if self.near_omega_h is not None and self.heteroclinic_closed
            else _CLAIM_BITS
        )

    @property
    def evidence(self) -> dict[str, Any]:
        """What the certificate records and the kernel has accepted: the evidence of each arc,
        and that of the cycles next to the connection if they are reached.

        It is empty if nothing is proved from the Hopf point on.
        """
        if not self.hopf_closed:
            return {}
        arcs = {"arcs": [arc.evidence for arc in self.arcs]}
        return arcs | (
            {"end": self.near_omega_h.evidence}
            if self.near_omega_h is not None and self.heteroclinic_closed
            else {}
        )

    @property
    def statement(self) -> str:
        return sentence(self.claim) if self.hopf_closed else f"nothing is proved: {self.reason}."

    @property
    def reason(self) -> str:
        """The reason why the proved curve of limit cycles does not go further, in words."""
        if self.stop_reason is None:
            return "no more was asked for" if self.arcs else "nothing was tried"
        where = f"from gamma_bar_0 = {exact_text(self.arcs[-1].high if self.arcs else Fraction(0))} rad on"
        return f"{where} {self.stop_reason.value}"

    def to_dict(self) -> dict[str, object]:
        """Return this proof as a dictionary for the command line: its statement, numbers and arcs.

        The entry ``ends`` has two parts, one for each end of the family. Each part states whether
        that end of the range of speeds is reached and, if it is not, the reason.
        """
        hopf, share = self.hopf_closed, self.covered
        ends: dict[str, dict[str, object]] = {
            "hopf": {"closed": hopf},
            "heteroclinic": {"closed": self.heteroclinic_closed},
        }
        if not hopf:
            ends["hopf"]["reason"] = self.reason
        if not self.heteroclinic_closed:
            reason = "no proof of the cycles next to the connection reaches the curve's end"
            if self.near_omega_h is not None and not self.near_omega_h.proved:
                reason = self.near_omega_h.statement
            ends["heteroclinic"]["reason"] = f"{reason}; {self.reason}"
        elif self.near_omega_h is not None:
            entry = self.near_omega_h.to_dict()
            ends["heteroclinic"] |= {
                name: entry[name] for name in ("from", "to", "gamma", "v", "numbers")
            }
        entries: dict[str, object] = {
            "proved": self.proved,
            "covered": None if share is None else Measured(share, Fraction(0)).decimals()[0],
            "statement": self.statement,
            "ends": ends,
        }
        entries["omega_crit"] = measured_omega_crit(self.parameters).to_dict()
        if (
            self.connection is not None
            and self.connection.omega_h is not None
            and self.connection.proved
        ):
            entries["omega_h"] = self.connection.omega_h.to_dict()
        if hopf:
            claim = self.claim
            entries |= {
                name: claim[name] for name in ("amplitude_end", "omega_end", "unique_within")
            }
        arcs = [arc_entry(arc) for arc in self.arcs]
        return entries | {"arcs": arcs, "parameters": self.parameters.name}
