/* Answers a sheet of questions on the reduced tippedisk model: right-hand side, equilibria, trajectories, cycles.
 *
 *     cc -O2 -std=c99 -Wall -Wextra -o client client.c -lm
 *     ./client SHEET.csv ANSWERS.csv [FAULT]
 *
 * The inputs are rounded to doubles; the arithmetic is long double where the machine has one, so that the usual loss of
 * a few digits stays below the double it is printed as.  FAULT 1 to 16 plants one deliberate mistake (see `on`). */
#include <float.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

typedef long double real;
enum { ID, LEVEL, KIND, SET, FRICTION, QUANTITY, UNIT, R, E, MASS, IA, IB, GRAV, MU, EPSILON, OMEGA, BETA, GAMMA, V, T,
       N, ORDER, EQUILIBRIUM, FORM, FROM, ANSWER, COLUMNS };
enum { DBETA, DGAMMA, DV, DOMEGA };            /* what the model is differentiated by; the first three are the state */
enum { SECTION, KINK, FLAT, TURN };            /* events: beta = pi/2, gamma_y = 0, sin(beta) = 0, v = 0 */
static const real PI = 3.14159265358979323846264338327950288L;
static int fault;

/* Fault 13 is faults 1 and 5 at once. */
static int on(int n) { return fault == n || (fault == 13 && (n == 1 || n == 5)); }
static real sign_of(int n) { return on(n) ? -1 : 1; }

/* ---- the model ---- */
/* side: the smooth law is analytic on either side of gamma_y = 0, but its second derivative jumps there.  With side
 * = +-1, |gamma_y| is side*gamma_y, so that an integration step never sees the kink; 0 takes the sign of gamma_y. */
typedef struct { real r, e, m, A, Bbar, g, mu, eps, Omega; int smooth, side; } Model;
typedef struct { real f, d[4]; } Value;                     /* a function and its derivatives */
typedef struct { Value M, h, f_G, w_y, gamma_y, gamma_rate, lambda, v_rate; } Rhs;

/* q += factor b(beta) g(gamma) v^i Omega^j; every function of the model is a sum of such terms */
static void add(Value *q, real factor, real b, real b_beta, real g, real g_gamma, real v, int i, real Omega, int j)
{
    real vi = i == 0 ? 1 : i == 1 ? v : v * v, dvi = i == 0 ? 0 : i == 1 ? 1 : 2 * v;
    real wj = j == 0 ? 1 : j == 1 ? Omega : Omega * Omega, dwj = j == 0 ? 0 : j == 1 ? 1 : 2 * Omega;
    q->f += factor * b * g * vi * wj;
    q->d[DBETA] += factor * b_beta * g * vi * wj;
    q->d[DGAMMA] += factor * b * g_gamma * vi * wj;
    q->d[DV] += factor * b * g * dvi * wj;
    q->d[DOMEGA] += factor * b * g * vi * dwj;
}

static void rhs(const Model *p, const real y[3], Rhs *o)
{
    real sb = sinl(y[0]), cb = cosl(y[0]), sg = sinl(y[1]), cg = cosl(y[1]), v = y[2], W = p->Omega, m = p->m, e = p->e;
    real rho = p->r + e * sg, rho_g = e * cg, D = p->A - p->Bbar, I = p->A * cg * cg + p->Bbar * sg * sg;
    real I_g = -2 * D * sg * cg, rm = on(14) ? p->r : rho, rf = on(15) ? p->r : rho;
    real c2b = cb * cb - sb * sb, c2g = cg * cg - sg * sg, q = 3 * sb * sb - 2;
    memset(o, 0, sizeof *o);
    add(&o->M, 1, 1, 0, I, I_g, v, 0, W, 0);
    add(&o->M, m, cb * cb, -2 * sb * cb, rm * rm, on(14) ? 0 : 2 * rho * rho_g, v, 0, W, 0);
    add(&o->h, 1, sb * cb, c2b, I, I_g, v, 0, W, 2);
    add(&o->h, -2 * D * sign_of(1), cb, -sb, sg * cg, c2g, v, 1, W, 1);
    add(&o->h, m * sign_of(2), sb * cb, c2b, rho * rho, 2 * rho * rho_g, v, 2, W, 0);
    add(&o->h, m * e * sign_of(3), on(12) ? sb * cb : sb * cb * cb * cb,
        on(12) ? c2b : cb * cb * (cb * cb - 3 * sb * sb), rho * sg, rho_g * sg + rho * cg, v, 0, W, 2);
    add(&o->h, -m * e * sign_of(4), q * cb, 6 * sb * cb * cb - q * sb, rho * cg, rho_g * cg - rho * sg, v, 1, W, 1);
    add(&o->f_G, -m * p->g, cb, -sb, rf, on(15) ? 0 : rho_g, v, 0, W, 0);
    add(&o->w_y, 1, sb, cb, rho, rho_g, v, 0, W, 0);
    add(&o->gamma_y, 1, sb, cb, rho, rho_g, v, 1, W, 0);
    add(&o->gamma_y, -e, on(5) ? sb : sb * sb, on(5) ? cb : 2 * sb * cb, cg, -sg, v, 0, W, 1);
    add(&o->gamma_rate, -sign_of(11), cb, -sb, 1, 0, v, 0, W, 1);

    real side = p->side ? p->side : o->gamma_y.f < 0 ? -1 : 1, d = p->smooth ? side * o->gamma_y.f + p->eps : p->eps;
    real force = -p->mu * m * p->g * (on(16) ? 1.1L : 1), slope = p->smooth ? force * p->eps / (d * d) : force / d;
    o->lambda.f = force * o->gamma_y.f / d;
    o->v_rate.f = (o->h.f + o->f_G.f + o->w_y.f * o->lambda.f) / o->M.f;
    for (int i = 0; i < 4; i++) {
        o->lambda.d[i] = slope * o->gamma_y.d[i];
        o->v_rate.d[i] = (o->h.d[i] + o->f_G.d[i] + o->w_y.d[i] * o->lambda.f + o->w_y.f * o->lambda.d[i]
                          - o->v_rate.f * o->M.d[i]) / o->M.f;
    }
}

/* Value of an event function, and its rate along the solution in *rate. */
static real event(const Model *p, int which, const real y[3], real *rate)
{
    Rhs o;
    rhs(p, y, &o);
    switch (which) {
    case SECTION: *rate = y[2]; return y[0] - PI / 2;
    case FLAT: *rate = y[2] * cosl(y[0]); return sinl(y[0]);
    case TURN: *rate = o.v_rate.f; return y[2];
    default: *rate = o.gamma_y.d[DBETA] * y[2] + o.gamma_y.d[DGAMMA] * o.gamma_rate.f + o.gamma_y.d[DV] * o.v_rate.f;
             return o.gamma_y.f;
    }
}

/* The side of an event function the solution moves on from y: on the event itself the rate decides. */
static int side_of(const Model *p, int which, const real y[3])
{
    real rate, value = event(p, which, y, &rate);
    return (fabsl(value) > 1e-15L ? value : rate) < 0 ? -1 : 1;
}

/* ---- integration (Gragg-Bulirsch-Stoer) ---- */
/* FULL carries, after the state, its derivatives by gamma, v at the start and by Omega (three columns), and the
 * integral of the divergence of the vector field. */
enum { STATE = 3, FULL = 13, ROWS = 7, WORK = 8000 };
static int work;                               /* steps spent on the question at hand; beyond WORK it is given up */
static const real HMAX = 0.05L, TOL = LDBL_EPSILON < 1e-17L ? 1e-16L : 2e-14L;

static void field(const Model *p, int n, const real *y, real *f)
{
    Rhs o;
    rhs(p, y, &o);
    f[0] = y[2], f[1] = o.gamma_rate.f, f[2] = o.v_rate.f;
    if (n == STATE) return;
    for (int c = 1; c <= 3; c++) {
        const real *u = y + 3 * c;
        real *du = f + 3 * c;
        du[0] = u[2];
        du[1] = o.gamma_rate.d[DBETA] * u[0];
        du[2] = o.v_rate.d[DBETA] * u[0] + o.v_rate.d[DGAMMA] * u[1] + o.v_rate.d[DV] * u[2];
    }
    f[10] += o.gamma_rate.d[DOMEGA], f[11] += o.v_rate.d[DOMEGA];
    f[12] = o.v_rate.d[DV];
}

/* One extrapolation step of order 2 ROWS: the modified midpoint rule with 2, 4, ..., 2 ROWS substeps, whose error is
 * a series in the square of the substep.  Returns an estimate of the error. */
static real step(const Model *p, int n, const real *y, real h, real *out)
{
    real t[ROWS][FULL], a[FULL], b[FULL], f[FULL], f0[FULL], error = 0;
    work++;
    field(p, n, y, f0);
    for (int j = 0; j < ROWS; j++) {
        real s = h / (2 * j + 2);
        for (int i = 0; i < n; i++) a[i] = y[i], b[i] = y[i] + s * f0[i];
        for (int k = 1; k < 2 * j + 2; k++) {
            field(p, n, b, f);
            for (int i = 0; i < n; i++) { real next = a[i] + 2 * s * f[i]; a[i] = b[i], b[i] = next; }
        }
        field(p, n, b, f);
        for (int i = 0; i < n; i++) t[j][i] = (a[i] + b[i] + s * f[i]) / 2;
        for (int k = j - 1; k >= 0; k--) {
            real ratio = (real)(j + 1) / (k + 1), w = 1 / (ratio * ratio - 1);
            for (int i = 0; i < n; i++) t[k][i] = t[k + 1][i] + w * (t[k + 1][i] - t[k][i]);
        }
    }
    for (int i = 0; i < n; i++) {
        real d = fabsl(t[0][i] - t[1][i]) / (1 + fabsl(t[0][i]));
        if (!(d <= error)) error = d;          /* written so that a NaN gets through */
        out[i] = t[0][i];
    }
    return error;
}

/* The length of the step from y, at most h, that ends on the event; its sign at the end of the whole step is `end`.
 * Newton's iteration on exact steps, kept inside a bracket. */
static real locate(const Model *p, int which, const real *y, real h, int end)
{
    real lo = 0, hi = h, s = h, z[3], rate, value;
    for (int i = 0; i < 60 && hi - lo > 0; i++) {
        step(p, STATE, y, s, z);
        value = event(p, which, z, &rate);
        if (value * end > 0) hi = s; else lo = s;
        real next = s - value / rate;
        if (!(next > lo && next < hi)) next = fabsl(next - s) <= 8 * LDBL_EPSILON * h ? s : (lo + hi) / 2;
        real moved = fabsl(next - s);
        s = next;
        if (moved <= 8 * LDBL_EPSILON * h) break;
    }
    return s;
}

/* Whether a function with one sign at both ends of the step seems to change it twice in between. */
static int dips(const Model *p, int which, const real *y, const real *z, real h)
{
    real d0, d1, g0 = event(p, which, y, &d0), g1 = event(p, which, z, &d1);
    if (g0 < 0) g0 = -g0, g1 = -g1, d0 = -d0, d1 = -d1;
    if (h < 1e-5L || g1 < 0 || d0 >= 0 || d1 <= 0) return 0;
    return g0 < d0 * d0 * h / (2 * (d1 - d0)) || g1 < d1 * d1 * h / (2 * (d1 - d0));
}

/* One accepted step from y of about the length *h, ending at the kink of the friction law if that comes first.
 * Returns the length (0: failed), proposes the next in *h.  p->side is left to the caller, who may repeat the step. */
static real advance(const Model *p, int n, const real *y, real *h, real *out)
{
    for (int tries = 0; tries < 40 && work < WORK; tries++) {
        real error = step(p, n, y, *h, out), used = *h, rate;
        real factor = isfinite(error) ? 0.9L * powl(TOL / (error + 1e-30L), 1.0L / (2 * ROWS - 1)) : 0.1L;
        factor = factor < 0.1L ? 0.1L : factor > 3 ? 3 : factor;
        if (!(error <= TOL)) { *h *= factor; continue; }
        if (dips(p, SECTION, y, out, *h) || (p->smooth && dips(p, KINK, y, out, *h))) { *h /= 2; continue; }
        if (p->smooth && event(p, KINK, out, &rate) * p->side < 0) {
            used = locate(p, KINK, y, *h, -p->side);
            step(p, n, y, used, out);
        } else *h = fminl(HMAX, *h * factor);
        return used;
    }
    return 0;
}

/* ---- trajectories ---- */
enum { MAXSTEPS = WORK, MAXCROSSINGS = 2000 };
static const real RUN = 10, START = 0.01L;     /* the start lies on the section: no crossing counts before START */
typedef struct { real t, y[3]; int side; } Point;
typedef struct { Model p; Point *at, crossing[MAXCROSSINGS]; int points, crossings; real end, flat; } Trajectory;

static Trajectory *trajectory(Model p, const real start[3])
{
    Trajectory *q = calloc(1, sizeof *q);
    q->at = malloc(MAXSTEPS * sizeof *q->at);
    q->p = p, q->flat = -1;
    real t = 0, h = 1e-3L, y[3], z[3], rate;
    memcpy(y, start, sizeof y);
    int above = side_of(&p, SECTION, y), upright = side_of(&p, FLAT, y);
    while (t < RUN && q->points < MAXSTEPS) {
        if (p.smooth) p.side = side_of(&p, KINK, y);
        Point here = { t, { y[0], y[1], y[2] }, p.side };
        real used = advance(&p, STATE, y, &h, z);
        if (used == 0) break;
        q->at[q->points++] = here;
        if (event(&p, SECTION, z, &rate) * above < 0) {
            real s = locate(&p, SECTION, y, used, above = -above);
            if (t + s >= START && t + s <= RUN && q->crossings < MAXCROSSINGS) {
                Point *c = &q->crossing[q->crossings++];
                step(&p, STATE, y, s, c->y);
                c->t = t + s;
            }
        }
        q->end = t + used;
        if (event(&p, FLAT, z, &rate) * upright < 0) {
            q->end = t + locate(&p, FLAT, y, used, -upright);
            if (q->end <= RUN) q->flat = q->end;
            break;
        }
        memcpy(y, z, sizeof y);
        t += used;
    }
    return q;
}

/* The state at time t: one more step, of the right length, from the last point before t. */
static int sample(Trajectory *q, real t, real out[3])
{
    if (!(t >= 0 && t <= q->end) || q->points == 0) return 0;
    int lo = 0, hi = q->points;
    while (hi - lo > 1) { int mid = (lo + hi) / 2; if (q->at[mid].t <= t) lo = mid; else hi = mid; }
    q->p.side = q->at[lo].side;
    step(&q->p, STATE, q->at[lo].y, t - q->at[lo].t, out);
    return 1;
}

/* ---- limit cycles ---- */
typedef struct { real x[2], map[2], D[2][3], half, dhalf[3], divergence, beta_max; } Half;
typedef struct { int ok; real period, gamma_bar, v, beta_max, slow, log_slow, log_fast, dperiod; } Cycle;

/* From (pi/2, pi/2 + x[0], x[1]) with v < 0 to the next beta = pi/2, then through the symmetry (beta, gamma, v) ->
 * (pi - beta, pi - gamma, -v): a cycle is a fixed point.  D: derivative of the map by x[0], x[1], Omega. */
static int half_map(Model p, int n, Half *q)
{
    real y[FULL] = { PI / 2, PI / 2 + q->x[0], q->x[1] }, z[FULL], h = 1e-3L, t = 0, rate;
    y[4] = y[8] = 1;
    q->beta_max = 0;
    for (int k = 0; k < 1500 && t < 6; k++) {
        if (p.smooth) p.side = side_of(&p, KINK, y);
        real used = advance(&p, n, y, &h, z), w[3];
        if (used == 0 || sinl(z[0]) <= 0 || fabsl(z[1] - PI / 2) > 2 * PI) return 0;
        if (y[2] * z[2] < 0) {
            step(&p, STATE, y, locate(&p, TURN, y, used, z[2] < 0 ? -1 : 1), w);
            q->beta_max = fmaxl(q->beta_max, fabsl(w[0] - PI / 2));
        }
        if (event(&p, SECTION, z, &rate) > 0) {
            real s = locate(&p, SECTION, y, used, 1);
            step(&p, n, y, s, z);
            q->half = t + s, q->divergence = z[12];
            q->map[0] = PI / 2 - z[1], q->map[1] = -z[2];
            Rhs o;
            rhs(&p, z, &o);
            for (int c = 0; n == FULL && c < 3; c++) {      /* the change of the arrival time projects on the section */
                const real *u = z + 3 + 3 * c;
                q->dhalf[c] = -u[0] / z[2];
                q->D[0][c] = -(u[1] + o.gamma_rate.f * q->dhalf[c]);
                q->D[1][c] = -(u[2] + o.v_rate.f * q->dhalf[c]);
            }
            return isfinite(q->map[0]) && q->map[1] < 0;
        }
        memcpy(y, z, sizeof y);
        t += used;
    }
    return 0;
}

/* x with (1 - D) x = rhs */
static void solve(const Half *q, real r0, real r1, real x[2])
{
    real a = 1 - q->D[0][0], b = -q->D[0][1], c = -q->D[1][0], d = 1 - q->D[1][1], det = a * d - b * c;
    x[0] = (d * r0 - b * r1) / det, x[1] = (a * r1 - c * r0) / det;
}

static int newton(const Model *p, Half *q)
{
    real dx[2], size = 1, last;
    for (int i = 0; i < 12; i++) {
        if (!half_map(*p, FULL, q)) return 0;
        solve(q, q->map[0] - q->x[0], q->map[1] - q->x[1], dx);
        last = size, size = hypotl(dx[0], dx[1]);
        if (size < 20 * TOL || (size < 1e-9L && size >= last)) return fabsl(q->x[0]) > 1e-3L;   /* no equilibrium */
        if (!(size < 1)) return 0;
        q->x[0] += dx[0], q->x[1] += dx[1];
    }
    return 0;
}

/* The cycles attract: from a rough guess some half turns bring the state close enough for Newton's method. */
static Cycle cycle(Model p)
{
    static const real guess[] = { 1.69L, 2.5L, 1, 3 };
    Half q;
    Cycle o = { 0 };
    for (int g = 0; g < 4 && !o.ok; g++) {
        q.x[0] = guess[g], q.x[1] = -guess[g];
        for (int round = 0, alive = 1; round < 3 && alive && !o.ok; round++) {
            for (int i = 0; i < 2 + 10 * round && alive; i++) {
                alive = half_map(p, STATE, &q) && fabsl(q.map[0]) > 0.02L;
                memcpy(q.x, q.map, sizeof q.x);
            }
            real keep[2] = { q.x[0], q.x[1] };
            if (alive && !(o.ok = newton(&p, &q))) memcpy(q.x, keep, sizeof keep);
        }
    }
    if (!o.ok) return o;
    o.period = 2 * q.half, o.gamma_bar = q.x[0], o.v = q.x[1], o.beta_max = q.beta_max;
    /* The product of the multipliers of the half map follows from the divergence (Liouville) to full relative accuracy;
     * in the determinant of D it is lost to cancellation. */
    real trace = q.D[0][0] + q.D[1][1], det = expl(q.divergence), root = trace * trace / 4 - det;
    real half = root > 0 ? trace / 2 + copysignl(sqrtl(root), trace) : NAN;
    o.slow = half * half, o.log_slow = 2 * logl(fabsl(half)), o.log_fast = 2 * q.divergence - o.log_slow;
    real dx[2];
    solve(&q, q.D[0][2], q.D[1][2], dx);
    o.dperiod = 2 * (q.dhalf[0] * dx[0] + q.dhalf[1] * dx[1] + q.dhalf[2]);
    return o;
}

/* ---- equilibria ---- */
/* Eigenvalues of the linearization, sorted by falling real, then imaginary part.  A real root of the characteristic
 * cubic x^3 + a x^2 + b x + c is found by bracketed Newton and divided out in the direction stable for its size. */
static void eigenvalues(const Model *p, int inverted, real l[6])
{
    Rhs o;
    real y[3] = { PI / 2, inverted ? PI / 2 : -PI / 2, 0 }, a, b, c;
    rhs(p, y, &o);
    a = -o.v_rate.d[DV], b = -o.v_rate.d[DBETA], c = -o.v_rate.d[DGAMMA] * o.gamma_rate.d[DBETA];
    real hi = 1 + fmaxl(fabsl(a), fmaxl(fabsl(b), fabsl(c))), lo = -hi, x = -a;
    for (int i = 0; i < 300 && hi > lo; i++) {
        real value = ((x + a) * x + b) * x + c, next = x - value / ((3 * x + 2 * a) * x + b);
        if (value > 0) hi = x; else lo = x;
        if (fabsl(next - x) <= 2 * LDBL_EPSILON * fabsl(x)) break;
        x = next > lo && next < hi ? next : (lo + hi) / 2;
    }
    real q = -c / x, s = (q - b) / x;                      /* the other two: x^2 + s x + q */
    if (fabsl(x) < cbrtl(fabsl(c))) s = a + x, q = b + x * s;
    real d = s * s / 4 - q, u = d < 0 ? -s / 2 : -s / 2 - copysignl(sqrtl(d), s), w = d < 0 ? -s / 2 : q / u;
    real root[3][2] = { { x, 0 }, { fmaxl(u, w), d < 0 ? sqrtl(-d) : 0 }, { fminl(u, w), d < 0 ? -sqrtl(-d) : 0 } };
    int first = x > root[1][0] ? 0 : x > root[2][0] ? 1 : 2;        /* the place of x among the other two, in order */
    for (int i = 0, k = 1; i < 3; i++) {
        const real *from = i == first ? root[0] : root[k++];
        l[2 * i] = from[0], l[2 * i + 1] = from[1];
    }
}

/* ---- the sheet ---- */
typedef struct { char **row; Trajectory *t; Cycle c; } Memo;

static real number(char **row, int column) { return strtod(row[column], NULL); }
static real parameter(char **row, int column) { return on(9) ? (float)number(row, column) : number(row, column); }
static real angle(char **row, int column)
{
    real x = number(row, column);
    return on(7) ? x * PI / 180 : on(8) ? x + PI / 2 : x;
}

static Model model(char **row)
{
    Model p = { parameter(row, R), parameter(row, E), parameter(row, MASS), parameter(row, IA), parameter(row, IB),
                parameter(row, GRAV), parameter(row, MU), parameter(row, EPSILON), number(row, OMEGA),
                strcmp(row[FRICTION], "smooth") == 0, 0 };
    if (on(10)) { real A = p.A; p.A = p.Bbar, p.Bbar = A; }
    if (!on(6)) p.Bbar -= p.m * p.e * p.e;
    return p;
}

/* Each trajectory and cycle is computed for the first row that asks for it. */
static Memo *memo(char **row)
{
    static Memo *list;
    static int used, space;
    for (int i = used - 1; i >= 0; i--) {
        int same = strcmp(list[i].row[KIND], row[KIND]) == 0 && strcmp(list[i].row[FRICTION], row[FRICTION]) == 0;
        for (int c = R; c <= V && same; c++) same = strcmp(list[i].row[c], row[c]) == 0;
        if (same) return &list[i];
    }
    if (used == space) list = realloc(list, (space = 2 * space + 64) * sizeof *list);
    Memo *m = &list[used++];
    memset(m, 0, sizeof *m);
    m->row = row;
    work = 0;
    real y[3] = { angle(row, BETA), angle(row, GAMMA), number(row, V) };
    if (strcmp(row[KIND], "trajectory") == 0) m->t = trajectory(model(row), y);
    else m->c = cycle(model(row));
    return m;
}

/* The value whose name, among the names separated by blanks, is that of the quantity; NAN if there is none. */
static real pick(const char *name, const char *names, const real *values)
{
    char one[32];
    for (int i = 0, length; sscanf(names, "%31s%n", one, &length) == 1; i++, names += length)
        if (strcmp(one, name) == 0) return values[i];
    return NAN;
}

static real answer(char **row)                             /* NAN: no answer */
{
    const char *kind = row[KIND], *what = row[QUANTITY];
    Model p = model(row);
    if (strcmp(kind, "rhs") == 0) {
        Rhs o;
        rhs(&p, (real[3]){ angle(row, BETA), angle(row, GAMMA), number(row, V) }, &o);
        real values[] = { o.M.f, o.h.f, o.f_G.f, o.w_y.f, o.gamma_y.f, o.gamma_rate.f, o.lambda.f, o.v_rate.f,
                          o.v_rate.d[DBETA], o.v_rate.d[DGAMMA], o.v_rate.d[DV] };
        return pick(what, "M h f_G w_y gamma_y gamma_rate lambda_Ty v_rate dv_rate_dbeta dv_rate_dgamma dv_rate_dv",
                    values);
    }
    if (strcmp(kind, "equilibrium") == 0) {
        real values[6];
        eigenvalues(&p, strcmp(row[EQUILIBRIUM], "inverted") == 0, values);
        return pick(what, "lambda_1_re lambda_1_im lambda_2_re lambda_2_im lambda_3_re lambda_3_im", values);
    }
    if (strcmp(kind, "trajectory") == 0) {
        Trajectory *q = memo(row)->t;
        real y[3];
        if (strcmp(what, "flat_time") == 0) return q->flat >= 0 ? q->flat : NAN;
        if (strncmp(what, "crossing", 8) != 0)
            return sample(q, number(row, T), y) ? pick(what, "beta gamma v", y) : NAN;
        int n = atoi(row[N]);
        if (n < 1 || n > q->crossings) return NAN;
        Point *c = &q->crossing[n - 1];
        return pick(what, "crossing_time crossing_gamma crossing_v", (real[3]){ c->t, c->y[1], c->y[2] });
    }
    if (strcmp(kind, "limit-cycle") == 0 || strcmp(kind, "near-heteroclinic") == 0) {
        Cycle c = memo(row)->c;
        if (c.ok) return pick(what, "period gamma_bar_0 v_0 beta_max multiplier_slow log_multiplier_slow "
                                    "log_multiplier_fast dperiod_domega", &c.period);
    }
    return NAN;
}

int main(int argc, char **argv)
{
    if (argc < 3) return fprintf(stderr, "usage: client SHEET.csv ANSWERS.csv [FAULT]\n"), 2;
    fault = argc > 3 ? atoi(argv[3]) : 0;
    FILE *in = fopen(argv[1], "r"), *out = fopen(argv[2], "w");
    if (!in || !out) return fprintf(stderr, "cannot open %s\n", in ? argv[2] : argv[1]), 1;
    static char buffer[1 << 16];
    for (int line = 0; fgets(buffer, sizeof buffer, in); line++) {
        char **row = calloc(COLUMNS, sizeof *row), *text = strcpy(malloc(strlen(buffer) + 1), buffer), value[40] = "";
        for (int c = 0; c < COLUMNS; c++) {                 /* never freed: the memo points to them */
            row[c] = text;
            text += strcspn(text, ",\r\n");
            if (*text) *text++ = 0;
        }
        real x = line ? answer(row) : NAN;
        if (isfinite(x)) snprintf(value, sizeof value, "%.17g", (double)x), row[FROM] = "doubles";
        if (line) row[ANSWER] = value;
        for (int c = 0; c < COLUMNS; c++) fprintf(out, c ? ",%s" : "%s", row[c]);
        fputc('\n', out);
    }
    return fclose(out) != 0;
}
