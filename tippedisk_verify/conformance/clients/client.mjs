// A program to start from, in JavaScript: it answers levels 1 and 6 of a sheet of questions on the reduced tippedisk.
//
//     node client.mjs sheet.csv answers.csv
//
// To grade a program of your own, call it in place of `model` (level 1) and of `advance` (level 6), and add kinds of
// questions to `answer`. What it does not answer stays empty.
import { readFileSync, writeFileSync } from 'node:fs';

const { sin, cos, abs, round, max } = Math;
const STEP = 1e-4;                                     // of the integrator [s]

// ---- the equations of motion at y = [beta, gamma, v] ----
function model(p, [beta, gamma, v]) {
  const { r, e, m, A, B, g, mu, epsilon, Omega } = p;
  const Bbar = B - m * e ** 2, rho = r + e * sin(gamma);
  const sb = sin(beta), cb = cos(beta), sg = sin(gamma), cg = cos(gamma);
  const inertia = A * cg ** 2 + Bbar * sg ** 2;
  const M = inertia + m * rho ** 2 * cb ** 2;
  const h = inertia * Omega ** 2 * sb * cb - 2 * (A - Bbar) * Omega * v * cb * sg * cg
    + m * rho ** 2 * v ** 2 * sb * cb + m * e * rho * Omega ** 2 * sb * cb ** 3 * sg
    - m * e * rho * (3 * sb ** 2 - 2) * Omega * v * cb * cg;
  const f_G = -m * g * rho * cb;
  const w_y = rho * sb;
  const gamma_y = rho * v * sb - e * Omega * sb ** 2 * cg;
  const lambda_Ty = -mu * m * g * gamma_y / (p.smooth ? abs(gamma_y) + epsilon : epsilon);
  return { M, h, f_G, w_y, gamma_y, lambda_Ty, gamma_rate: -Omega * cb, v_rate: (h + f_G + w_y * lambda_Ty) / M };
}

function field(p, y) {
  const { gamma_rate, v_rate } = model(p, y);
  return [y[2], gamma_rate, v_rate];
}

// ---- level 6: the classical method of Runge and Kutta, with equal steps of about STEP ----
const moved = (y, f, h) => y.map((x, i) => x + h * f[i]);

function advance(p, y, duration) {
  const steps = max(1, round(duration / STEP)), h = duration / steps;
  for (let n = 0; n < steps; n++) {
    const k1 = field(p, y), k2 = field(p, moved(y, k1, h / 2));
    const k3 = field(p, moved(y, k2, h / 2)), k4 = field(p, moved(y, k3, h));
    y = y.map((x, i) => x + h / 6 * (k1[i] + 2 * k2[i] + 2 * k3[i] + k4[i]));
  }
  return y;
}

let last = { key: '', t: 0, y: [] };                   // where the motion asked about last has got to

function state(key, p, start, t) {
  if (key !== last.key || t < last.t) last = { key, t: 0, y: start };
  if (t > last.t) last = { key, t, y: advance(p, last.y, t - last.t) };
  return last.y;
}

// ---- the sheet ----
function answer(row) {                                 // a number, or nothing
  const p = { smooth: row.friction === 'smooth' };
  for (const name of ['r', 'e', 'm', 'A', 'B', 'g', 'mu', 'epsilon', 'Omega']) p[name] = Number(row[name]);
  const y = [row.beta, row.gamma, row.v].map(Number);
  if (row.kind === 'rhs') return model(p, y)[row.quantity];
  const place = ['beta', 'gamma', 'v'].indexOf(row.quantity);
  if (row.kind === 'trajectory' && place >= 0) return state(JSON.stringify([p, y]), p, y, Number(row.t))[place];
  return undefined;
}

const [sheet, output] = process.argv.slice(2);
const [header, ...lines] = readFileSync(sheet, 'utf8').split(/\r?\n/).filter(line => line);
const names = header.split(',');
const answers = ['id,from,answer'];
for (const line of lines) {
  const row = Object.fromEntries(line.split(',').map((field, i) => [names[i], field]));
  const x = answer(row);
  if (Number.isFinite(x)) answers.push(`${row.id},doubles,${x.toPrecision(17)}`);
}
writeFileSync(output, answers.join('\n') + '\n');
