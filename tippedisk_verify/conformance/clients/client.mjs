// Answers a sheet of questions on the reduced tippedisk model: right-hand side, equilibria, trajectories.
//
//     node client.mjs SHEET.csv ANSWERS.csv
import { readFileSync, writeFileSync } from 'node:fs';

const { sin, cos, abs, sqrt, max, min, sign, PI } = Math;
const RUN = 10, TOLERANCE = 1e-13;

function model(p, [beta, gamma, v]) {
  const { r, e, m, A, B, g, mu, epsilon, Omega, smooth } = p;
  const Bbar = B - m * e * e, sb = sin(beta), cb = cos(beta), sg = sin(gamma), cg = cos(gamma), rho = r + e * sg;
  const inertia = A * cg ** 2 + Bbar * sg ** 2;
  const M = inertia + m * rho ** 2 * cb ** 2;
  const h = inertia * Omega ** 2 * sb * cb - 2 * (A - Bbar) * Omega * v * cb * sg * cg + m * rho ** 2 * v ** 2 * sb * cb
    + m * e * rho * Omega ** 2 * sb * cb ** 3 * sg - m * e * rho * (3 * sb ** 2 - 2) * Omega * v * cb * cg;
  const f_G = -m * g * rho * cb, w_y = rho * sb, gamma_y = rho * v * sb - e * Omega * sb ** 2 * cg;
  const lambda_Ty = -mu * m * g * gamma_y / (smooth ? abs(gamma_y) + epsilon : epsilon);
  return { M, h, f_G, w_y, gamma_y, gamma_rate: -Omega * cb, lambda_Ty, v_rate: (h + f_G + w_y * lambda_Ty) / M };
}

// The linearization at (pi/2, +-pi/2, 0) in closed form; there cos(beta) = cos(gamma) = 0 and sin(gamma) = s.
// Its characteristic polynomial is x^3 + a x^2 + b x + c.
function equilibrium(p, s) {
  const { r, e, m, A, B, g, mu, epsilon, Omega } = p;
  const Bbar = B - m * e * e, rho = r + e * s, drag = mu * m * g * rho / (epsilon * Bbar);
  const a = drag * rho, b = Omega ** 2 - m * g * rho / Bbar, c = drag * e * s * Omega ** 2;
  const f = x => ((x + a) * x + b) * x + c;
  let hi = 1 + max(abs(a), abs(b), abs(c)), lo = -hi;
  for (let x = 0; ; ) {                                  // bisection: slow and sure
    x = (lo + hi) / 2;
    if (x <= lo || x >= hi) break;
    if (f(x) > 0) hi = x; else lo = x;
  }
  const x = abs(f(lo)) < abs(f(hi)) ? lo : hi;
  // The other two are the roots of x^2 + t x + q; divide from the end that loses no digits.
  let q = -c / x, t = (q - b) / x;
  if (abs(x) ** 3 < abs(c)) { t = a + x; q = b + x * t; }
  const d = t * t / 4 - q, u = -t / 2 - (sign(t) || 1) * sqrt(max(d, 0));
  const roots = d < 0 ? [[x, 0], [-t / 2, sqrt(-d)], [-t / 2, -sqrt(-d)]] : [[x, 0], [u, 0], [q / u, 0]];
  roots.sort((k, l) => l[0] - k[0] || l[1] - k[1]);
  return Object.fromEntries(roots.flatMap(([re, im], i) => [[`lambda_${i + 1}_re`, re], [`lambda_${i + 1}_im`, im]]));
}

const C = [[], [1 / 5], [3 / 40, 9 / 40], [44 / 45, -56 / 15, 32 / 9],
  [19372 / 6561, -25360 / 2187, 64448 / 6561, -212 / 729],
  [9017 / 3168, -355 / 33, 46732 / 5247, 49 / 176, -5103 / 18656],
  [35 / 384, 0, 500 / 1113, 125 / 192, -2187 / 6784, 11 / 84]];
const D = [71 / 57600, 0, -71 / 16695, 71 / 1920, -17253 / 339200, 22 / 525, -1 / 40];

function rate(p, y) {
  const f = model(p, y);
  return [y[2], f.gamma_rate, f.v_rate];
}

// One Dormand-Prince step of order 5; the error is an estimate.
function step(p, y, h) {
  const k = [];
  let z = y;
  for (const row of C) {
    z = y.map((x, i) => x + h * row.reduce((sum, c, j) => sum + c * k[j][i], 0));
    k.push(rate(p, z));
  }
  const error = max(...y.map((x, i) => abs(h * D.reduce((sum, c, j) => sum + c * k[j][i], 0)) / (1 + abs(x))));
  return { z, error };
}

// The step from y, shorter than h, that ends on f = 0: Newton on exact steps, inside a bracket.
function locate(p, y, h, f, derivative) {
  const end = sign(f(step(p, y, h).z));
  let lo = 0, hi = h, s = h;
  for (let i = 0; i < 50; i++) {
    const { z } = step(p, y, s);
    if (f(z) * end > 0) hi = s; else lo = s;
    const newton = s - f(z) / derivative(z), next = newton >= lo && newton <= hi ? newton : (lo + hi) / 2;
    if (abs(next - s) <= 1e-16 * h || next === s) break;
    s = next;
  }
  return { s, z: step(p, y, s).z };
}

function trajectory(p, start) {
  const points = [], crossings = [];
  let y = start, t = 0, h = 1e-4, flat = null, end = 0;
  const offset = z => z[0] - PI / 2, height = z => sin(z[0]);
  const upright = sign(height(y));
  // on the section the velocity tells the side the solution goes to
  let side = sign(abs(offset(y)) > 1e-14 ? offset(y) : y[2] || rate(p, y)[2]);
  for (let n = 0; t < RUN && n < 1e6; n++) {
    const { z, error } = step(p, y, h);
    if (!(error <= TOLERANCE)) {
      h *= max(0.2, 0.9 * (TOLERANCE / error) ** 0.2 || 0.2);
      continue;
    }
    points.push({ t, y });
    if (offset(z) * side < 0) {
      const hit = locate(p, y, h, offset, x => x[2]);
      side = -side;
      if (t + hit.s <= RUN) crossings.push({ time: t + hit.s, gamma: hit.z[1], v: hit.z[2] });
    }
    end = t + h;
    if (height(z) * upright < 0) {
      end = t + locate(p, y, h, height, x => x[2] * cos(x[0])).s;
      if (end <= RUN) flat = end;
      break;
    }
    y = z;
    t += h;
    h = min(0.01, h * min(3, 0.9 * (TOLERANCE / (error + 1e-300)) ** 0.2));
  }
  return { p, points, crossings, flat, end };
}

function sample({ p, points, end }, t) {
  if (!(t >= 0 && t <= end)) return null;
  let lo = 0, hi = points.length;
  while (hi - lo > 1) {
    const mid = (lo + hi) >> 1;
    if (points[mid].t <= t) lo = mid; else hi = mid;
  }
  return step(p, points[lo].y, t - points[lo].t).z;
}

const memo = new Map();

function answer(row) {
  const p = { smooth: row.friction === 'smooth' };
  for (const name of ['r', 'e', 'm', 'A', 'B', 'g', 'mu', 'epsilon', 'Omega']) p[name] = Number(row[name]);
  const y = [row.beta, row.gamma, row.v].map(Number);
  if (row.kind === 'rhs') return model(p, y)[row.quantity];
  if (row.kind === 'equilibrium') return equilibrium(p, row.equilibrium === 'inverted' ? 1 : -1)[row.quantity];
  if (row.kind !== 'trajectory') return null;
  const key = JSON.stringify([p, y]);
  if (!memo.has(key)) memo.set(key, trajectory(p, y));
  const run = memo.get(key);
  if (row.quantity === 'flat_time') return run.flat;
  if (row.quantity.startsWith('crossing_')) return run.crossings[row.n - 1]?.[row.quantity.slice(9)];
  return sample(run, Number(row.t))?.[['beta', 'gamma', 'v'].indexOf(row.quantity)];
}

const [sheet, output] = process.argv.slice(2);
const [header, ...lines] = readFileSync(sheet, 'utf8').split('\n').filter(line => line);
const names = header.split(',');
const out = [header];
for (const line of lines) {
  const row = Object.fromEntries(line.split(',').map((field, i) => [names[i], field]));
  const value = answer(row);
  row.answer = '';
  if (Number.isFinite(value)) {
    row.answer = value.toPrecision(17);
    row.from = 'doubles';
  }
  out.push(names.map(name => row[name]).join(','));
}
writeFileSync(output, out.join('\n') + '\n');
