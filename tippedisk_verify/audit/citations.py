"""The published numbers of the paper's LaTeX labels; LaTeX counts them in document order.

Each numbered equation, figure, table and section of the paper is listed by its label in the order
of the source, so its number is its position. A "-" stands for a number without a label. tests/audit
derives the same numbers from an outline.
"""

from __future__ import annotations

__all__ = ["published_numbers"]

_EQUATIONS = """
    - 3DOF MassMatrix_3DOF GyroVector_3DOF force_3DOF gendir_3DOF gamma_y_3DOF lambda_y_3DOF lin_lambda_y_3DOF kin_3DOF
    - - 3DOF_lin A_coeff_O closed_la3 approx_omega_crit - - - - eqm_quartic MassMatrix_3DOF_approx
    GyroVector_3DOF_approx force_3DOF_approx genForce_3DOF_approx kin_rel - - harmonic_ansatz - harmonic_balance
    - - - - sin_balance cos_balance - kappa2 omega_sol_C2 omega_sol_C4 - - delta omegasol - Csquared Csol - - omega_sol
    - periodicity anchor_explicits - - - singular_str_t singular_slow_t singular_fast_t singular_str_tau
    singular_str_t1 - - singular_str_tau1 slow_manifold - - - 1eps0 1eps1 - - - - - per_system - per_g0 per_g1
    per_fast_subsystem critical_manifold_tippdisk slow_manifold_tippdisk - - - - -
"""
_FIGURES = "intro_inversion_COG intro_inversion fig1 bif_dia_3 HBM Shooting 3D sketch proj_3D"
_PANELS = "sub_hom hom sup_hom sup_hom_sub_crit sub_crit sup_crit"
_SECTIONS = {
    "model": "2",
    "linear3DOF": "3",
    "linear_stab3DOF": "3.1",
    "Nonlinear": "4",
    "shooting": "4.1",
    "singular": "4.2",
    "basics_singularperturbation": "4.2.1",
    "singular_tippedisk": "4.2.2",
    "dynamics": "5",
    "discussion": "6",
}


def _numbers() -> dict[str, tuple[str, str]]:
    """Return a dict from every label of the paper to its kind and printed number.

    An example is ``("eq.", "(48)")``.
    """
    numbers, latest = {}, ("", 0)
    for place, name in enumerate(_EQUATIONS.split(), start=1):
        if name != "-":
            latest = (name, place)
        after = f"+{place - latest[1]}" if name == "-" else ""
        numbers[f"eq:{latest[0]}{after}"] = ("eq.", f"({place})")
    figures = _FIGURES.split()
    numbers |= {
        f"fig:{name}": ("Figure", str(place)) for place, name in enumerate(figures, start=1)
    }
    for figure, ending in (("3D", ""), ("proj_3D", "_2D")):
        for letter, name in zip("abcdef", _PANELS.split(), strict=True):
            numbers[f"fig:{name}{ending}"] = ("Figure", f"{figures.index(figure) + 1}{letter}")
    numbers |= {
        f"tab:{name}": ("Table", str(place))
        for place, name in enumerate(("dim_mass", "initail"), start=1)
    }
    return numbers | {f"sec:{name}": ("Section", number) for name, number in _SECTIONS.items()}


_NUMBERS = _numbers()


def published_numbers(labels: str) -> str:
    """Return the published numbers of some LaTeX labels, as one text.

    ``eq:Csol`` gives "eq. (48)"; ``eq:3DOF_lin, fig:hom`` gives "eq. (13), Figure 7b". "eq:Csol+1"
    is the first numbered equation after eq:Csol if it has no label. "below eq:Csol" is the text
    there. "from eq:Csol" means that the items before it are derived from this equation.

    Args:
        labels: LaTeX labels, separated by ", ".

    Raises:
        KeyError: If the paper has no such label.
    """
    citations, before = [], [""]
    for label in labels.split(", "):
        *how, name = label.split()
        citations.append(" ".join((*(how if how != before else ()), *_NUMBERS[name])))
        before = how
    return ", ".join(citations)
