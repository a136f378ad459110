"""What the paper writes, claim by claim, in LaTeX: its formula, or the sentence's mathematical content."""

from __future__ import annotations

__all__ = ["FORMULAS"]


FORMULAS: dict[str, str] = {
    "table_1": r"r,\; e,\; m,\; A,\; B \;\mapsto\; \Omega_\text{crit},\; T_\text{crit},\; A_{33},\; \chi",
    "sliding_velocity": r"\gamma_y = (r + e\,\sin\gamma)\,\dot{\beta}\,\sin\beta - e\,\Omega\,\sin\beta^2\,\cos\gamma",
    "linearization": (
        r"A_{31} = \frac{m g}{\bar{B}}(r+e) - \Omega^2,"
        r"\quad A_{32} = -\frac{\mu m g}{\varepsilon\bar{B}}\,e(r+e)\,\Omega,"
        r"\quad A_{33} = -\frac{\mu m g}{\varepsilon\bar{B}}(r+e)^2"
    ),
    "omega_crit": r"\Omega_\text{crit} = \sqrt{\frac{(r+e)^2}{r}\,\frac{m g}{\bar{B}}}",
    "omega_crit_friction": (
        r"\frac{\partial\Omega_\text{crit}}{\partial\mu} = \frac{\partial\Omega_\text{crit}}{\partial\varepsilon} = 0"
    ),
    "lambda_3": r"\lambda_3 \approx -\frac{\mu m g}{\varepsilon\bar{B}}(r+e)^2",
    "lambda_3_order": r"\lambda_3 = A_{33} + \mathcal{O}(\varepsilon)",
    "critical_pair": r"\lambda_{1,2} = \pm i\,\omega \quad\text{at}\quad \Omega = \Omega_\text{crit}",
    "inverted_stable_above": r"\Re\lambda_i < 0 \quad\text{for}\quad \Omega > \Omega_\text{crit}",
    "inverted_unstable_below": r"\Re\lambda_{1,2} > 0 \quad\text{for}\quad \Omega < \Omega_\text{crit}",
    "noninverted_unstable": r"\max_i \Re\lambda_i > 0 \quad\text{at}\quad (\pi/2,\,-\pi/2,\,0)",
    "expansion_mass": (
        r"\tilde{M} = (A-\bar{B})\,\bar{\gamma}^2 + \bar{B} + m(r+e)^2\,\bar{\beta}^2 + \mathcal{O}(\|\bar{z}\|^4)"
    ),
    "expansion_gyroscopic": (
        r"\tilde{h} = -\bar{B}\Omega^2\bar{\beta} + (\bar{B}-A)\Omega^2\bar{\beta}\bar{\gamma}^2"
        r" + \left[\tfrac{2}{3}\bar{B} - m e(r+e)\right]\Omega^2\bar{\beta}^3"
        r" - 2\left[A-\bar{B}+m e(r+e)\right]\Omega\dot{\bar{\beta}}\bar{\beta}\bar{\gamma}"
        r" - m(r+e)^2\dot{\bar{\beta}}^2\bar{\beta} + \dots"
    ),
    "expansion_gravity": (
        r"f_G = m g(r+e)\bar{\beta} - \tfrac{1}{2} m g e\,\bar{\beta}\bar{\gamma}^3"
        r" - \tfrac{1}{6} m g(r+e)\bar{\beta}^3"
        r" + \dots"
    ),
    "expansion_friction": (
        r"w_y\lambda_{Ty} = -\frac{\mu m g}{\varepsilon}\left[-\Omega e\,\tfrac{4e+r}{6}\bar{\gamma}^3"
        r" + (r+e)^2\dot{\bar{\beta}} - \tfrac{3}{2}\Omega e(r+e)\bar{\beta}^2\bar{\gamma}"
        r" - (r+e)^2\dot{\bar{\beta}}\bar{\beta}^2 + e(r+e)\Omega\bar{\gamma}"
        r" - e(r+e)\dot{\bar{\beta}}\bar{\gamma}^2\right]"
        r" + \dots"
    ),
    "kappa_1": (
        r"\kappa_1 = \tfrac{1}{4}\left[\bar{B} - 3A - 2 m e(r+e)\right]\Omega^2 - \tfrac{1}{2} m(r+e)^2\omega^2"
        r" + \tfrac{1}{8} m g e\frac{\Omega^2}{\omega^2} - \tfrac{1}{4}(\bar{B}-A)\frac{\Omega^4}{\omega^2}"
        r" + \tfrac{1}{8} m g(r+e)"
    ),
    "kappa_2": (
        r"\kappa_2 = -e\,\frac{r+4e}{2}\,\frac{\Omega^4}{\omega^2} + \tfrac{3}{2} e(r+e)\Omega^2 + (r+e)^2\omega^2"
    ),
    "delta": r"\delta = -\frac{1}{8}\,\frac{r-e}{r+e}\,\Omega^2",
    "chi": r"\chi = A(r-2e) - \bar{B}\,\frac{2r^2+e(r+e)}{2(r+e)}",
    "amplitude_law": (
        r"C = 2\sqrt{\frac{e}{r+e}}\sqrt{-\frac{\bar{B}r\Omega^2 - m g(r+e)^2}{\chi\Omega^2 + m g e(r+e)}}"
        r" + \mathcal{O}(C^4)"
    ),
    "period_law": (
        r"\omega = \Omega\sqrt{\frac{e}{r+e}\left(1 + \frac{1}{2}\,\frac{r-e}{r+e}\,"
        r"\frac{\bar{B}r\Omega^2 - m g(r+e)^2}{\chi\Omega^2 + m g e(r+e)}\right)}"
    ),
    "supercritical": r"\chi\,\Omega_\text{crit}^2 + m g e(r+e) > 0",
    "period_crit": r"T_\text{crit} = \frac{2\pi}{\Omega_\text{crit}}\sqrt{\frac{r+e}{e}}",
    "convergent_series": r"h(x;\varepsilon) = h_0(x) + \varepsilon\,h_1(x) + \varepsilon^2 h_2(x) + \dots",
    "slow_manifold_h1": (
        r"h_1 = \left(\frac{\partial g}{\partial y}\right)^{-1}\left[\frac{\partial h_c}{\partial x}\,f(x,h_c)"
        r" - g_1(x,h_c)\right]"
    ),
    "attraction": (
        r"\frac{\partial g_0}{\partial y} = -\frac{\mu m g}{M}(r+e\,\sin\gamma)^2\,\sin^2\beta < 0"
        r"\quad\text{for}\quad \beta\in(0,\pi)"
    ),
    "reduced_dimension": r"\dot{x} = f(x,h(x)),\quad x = (\beta,\gamma)",
    "second_noninverted_state": r"x_\text{non} = (3\pi/2,\,\pi/2,\,0)",
    "order_0_noninverted": r"\dot{x} = f(x,h_c(x)) \quad\text{at}\quad (\pi/2,\,-\pi/2)",
    "order_0_hopf": r"\dot{x} = f(x,h_c(x)) \quad\text{at}\quad (\pi/2,\,\pi/2)",
    "order_1_hopf": r"\dot{x} = f(x,\,h_c(x) + \varepsilon h_1(x)) \;\Rightarrow\; \Omega_\text{crit}",
    "omega_h": r"\Omega_\text{h}:\quad W^u(\pi/2,\,-\pi/2,\,0) \cap W^s(\pi/2,\,3\pi/2,\,0) \neq \emptyset",
    "infinite_period": r"T \to \infty \quad\text{as}\quad \Omega \downarrow \Omega_\text{h}",
    "only_above_omega_h": r"\Omega_\text{h} < \Omega < \Omega_\text{crit}",
    "both_connections": r"(\pi/2,\,-\pi/2,\,0) \rightleftarrows (\pi/2,\,3\pi/2,\,0)",
    "homoclinic_identified": r"F(\beta,\,\gamma+2\pi,\,v) = F(\beta,\,\gamma,\,v)",
    "attracting_cycle": r"\lambda_u + \lambda_s < 0",
    "stable_branch": (
        r"|\mu_\text{slow}| < 1,\quad \frac{d\bar{\beta}_\text{max}}{d\Omega} < 0,\quad \frac{dT}{d\Omega} < 0"
    ),
    "table_2": r"(\bar{\beta}_0,\,\bar{\gamma}_0,\,\dot{\bar{\beta}}_0,\,T_0) = (0,\;1.69,\;-1.72,\;1.10)",
    "scene_a": r"\Omega = \Omega_\text{h} - 0.1",
    "scene_b": r"\Omega = \Omega_\text{h} + 0.01",
    "scene_c": r"\Omega = \Omega_\text{h} + 0.1",
    "scene_d": r"\Omega = \Omega_\text{crit} - 0.5",
    "scene_e": r"\Omega = \Omega_\text{crit} - 0.2",
    "scene_f": r"\Omega = \Omega_\text{crit} + 0.5",
    "permanent_contact": r"\frac{\lambda_N}{m g} > 0",
    "globally_attractive": r"\mathcal{M}_s \;\text{attracts}\; \{0 < \beta < \pi\}",
    "smooth_same_behaviour": (
        r"\lambda_{Ty} = -\frac{\mu m g}{\varepsilon}\gamma_y \;\sim\; -\mu m g\,\frac{\gamma_y}{|\gamma_y|+\varepsilon"
        r"}"
    ),
    "smooth_same_asymptotics": r"|\gamma_y| \ll \varepsilon",
    "almost_all_trajectories": r"x(t) \to (\pi/2,\,\pi/2,\,0) \quad\text{for}\quad \Omega > \Omega_\text{crit}",
}
