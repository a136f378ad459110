// Answers questions about the tippedisk's right-hand side, one JSON object a line (docs/protocol.md).
import { createInterface } from 'node:readline';

const { sin, cos, abs } = Math;

function rightHandSide({ r, e, m, A, B, g, mu, epsilon, Omega, beta, gamma, v }, friction) {
  const sb = sin(beta), cb = cos(beta), sg = sin(gamma), cg = cos(gamma), Bbar = B - m * e ** 2, rho = r + e * sg;
  const inertia = A * cg ** 2 + Bbar * sg ** 2, M = inertia + m * rho ** 2 * cb ** 2;
  const h = inertia * Omega ** 2 * sb * cb - 2 * (A - Bbar) * Omega * v * cb * sg * cg + m * rho ** 2 * v ** 2 * sb * cb
    + m * e * rho * Omega ** 2 * sb * cb ** 3 * sg - m * e * rho * (3 * sb ** 2 - 2) * Omega * v * cb * cg;
  const f_G = -m * g * rho * cb, w_y = rho * sb, gamma_y = rho * v * sb - e * Omega * sb ** 2 * cg;
  const lambda_Ty = -mu * m * g * gamma_y / (epsilon + (friction === 'smooth' ? abs(gamma_y) : 0));
  return { M, h, f_G, w_y, gamma_y, lambda_Ty, gamma_rate: -Omega * cb, v_rate: (h + f_G + w_y * lambda_Ty) / M };
}

const INPUTS = ['r', 'e', 'm', 'A', 'B', 'g', 'mu', 'epsilon', 'Omega', 'beta', 'gamma', 'v'];
for await (const line of createInterface({ input: process.stdin })) {
  const question = JSON.parse(line);
  let answer = null; // for all that this program does not know
  if (question.kind === 'rhs') {
    const inputs = Object.fromEntries(INPUTS.map(name => [name, Number(question[name])]));
    answer = rightHandSide(inputs, question.friction)[question.quantity] ?? null;
  }
  console.log(JSON.stringify({ id: question.id, answer, from: 'doubles' }));
}
