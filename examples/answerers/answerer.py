"""Answers questions about the tippedisk's right-hand side, one JSON object a line
(docs/protocol.md).
"""

import json
import math
import sys


def right_hand_side(inputs: list[float], smooth: bool) -> dict[str, float]:
    r, e, m, A, B, g, mu, epsilon, Omega, beta, gamma, v = inputs
    sb, cb, sg, cg = math.sin(beta), math.cos(beta), math.sin(gamma), math.cos(gamma)
    Bbar, rho = B - m * e**2, r + e * sg
    inertia = A * cg**2 + Bbar * sg**2
    M = inertia + m * rho**2 * cb**2
    h = (
        inertia * Omega**2 * sb * cb
        - 2 * (A - Bbar) * Omega * v * cb * sg * cg
        + m * rho**2 * v**2 * sb * cb
    )
    h += (
        m * e * rho * Omega**2 * sb * cb**3 * sg
        - m * e * rho * (3 * sb**2 - 2) * Omega * v * cb * cg
    )
    f_G, w_y, gamma_y = -m * g * rho * cb, rho * sb, rho * v * sb - e * Omega * sb**2 * cg
    lambda_Ty = -mu * m * g * gamma_y / (epsilon + (abs(gamma_y) if smooth else 0))
    answers = {"M": M, "h": h, "f_G": f_G, "w_y": w_y, "gamma_y": gamma_y, "lambda_Ty": lambda_Ty}
    return answers | {"gamma_rate": -Omega * cb, "v_rate": (h + f_G + w_y * lambda_Ty) / M}


INPUTS = ("r", "e", "m", "A", "B", "g", "mu", "epsilon", "Omega", "beta", "gamma", "v")
for line in sys.stdin:
    question = json.loads(line)
    answer = None  # for all that this program does not know
    if question["kind"] == "rhs":
        inputs = [float(question[name]) for name in INPUTS]
        answer = right_hand_side(inputs, question["friction"] == "smooth").get(question["quantity"])
    print(json.dumps({"id": question["id"], "answer": answer, "from": "doubles"}), flush=True)
