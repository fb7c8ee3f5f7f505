/*
@HEAD@
 */
#include "model.h"

#include <math.h>
#define FOR(i, n) for (int i = 0; i < (n); i++)
#define GUARD(q, dq, ddq) \
    df_status status = check(j, q, dq, ddq); \
    if (status == DF_BAD_INPUT) return status; \
    const Joint *m = &MODEL[j];

/* c: of 1, sin q, cos q, q, dq, sign(dq), z.  kind: of z.  set: of bodies, or -1.  range: of q, dq, tau. */
typedef struct { df_real value, std, ddq, c[7], scale; int kind, friction; } Term;
typedef struct { int parent, coordinate, slides; df_real T[3][4]; } Link;
typedef struct {
    int row, set, terms;
    const Term *term;
    df_real range[3][2], R[2], Q[3][3], start, edge[3], factor[4], model_variance, alarm, lag;
} Joint;
enum { LINKS = @LINKS@ };
enum { BEGINS = 1 }; /* runs: samples since the filter began */
static const double TRANSIENT = 1, GAP = 1.5, MEAN = 200, TOLERANCE = 0.02; /* [s], periods in a gap, samples in the pace, and its error */
static const df_real T = DF_PERIOD;
static const df_real GRAVITY = @GRAVITY@, UP[3] = @UP@, STILL[DF_COORDINATES] = {0};
static const Link CHAIN[LINKS] = @CHAIN@;
static const df_real BODIES[][LINKS][10] = @BODIES@;
@TERMS@
static const Joint MODEL[DF_JOINTS] = {
@MODEL@
};

static df_real sign(df_real x) { return (df_real)((x > 0) - (x < 0)); }
static df_real limited(df_real x, df_real a, df_real b) { return fmax(-fmax(fabs(a), fabs(b)), fmin(fmax(fabs(a), fabs(b)), x)); }
static df_real state(const Term *p, df_real z, df_real q, df_real dq) {
    const df_real s = sign(dq), v = p->scale > 0 ? dq / p->scale : 0;
    const df_real of[] = {0, z, tanh(v), s * exp(-v * v), fabs(dq), fabs(dq) * dq, q * dq, q * s, q * q * s, q * q,
                         q * q * q, sin(2 * q), cos(2 * q), sin(3 * q), cos(3 * q)};
    return of[p->kind];
}
static df_real phi(const Term *p, df_real z, df_real q, df_real dq, df_real ddq) {
    const df_real *c = p->c;
    return p->ddq * ddq + c[0] + c[1] * sin(q) + c[2] * cos(q) + c[3] * q + c[4] * dq + c[5] * sign(dq)
        + c[6] * state(p, z, q, dq);
}
static void cross(const df_real *a, const df_real *b, df_real *y) { /* y += a x b */
    FOR(i, 3) y[i] += a[(i + 1) % 3] * b[(i + 2) % 3] - a[(i + 2) % 3] * b[(i + 1) % 3];
}
static void accelerate(const df_real *w, const df_real *e, const df_real *r, df_real *y) { /* y += e x r + w x (w x r) */
    df_real v[3] = {0};
    cross(w, r, v), cross(w, v, y), cross(e, r, y);
}

/* The effort of a coordinate by Newton and Euler, in the frames of the links.  Featherstone 2008, chapter 5. */
static df_real links_effort(int set, int row, const df_real *q, const df_real *dq, const df_real *ddq, df_real g) {
    df_real R[LINKS][3][3], r[LINKS][3], w[LINKS + 1][3] = {{0}}, e[LINKS + 1][3] = {{0}}, a[LINKS + 1][3] = {{0}};
    df_real f[LINKS + 1][3] = {{0}}, n[LINKS + 1][3] = {{0}}, tau = 0;
    FOR(i, 3) a[0][i] = g * UP[i];
    FOR(l, LINKS) {
        const Link *L = &CHAIN[l];
        const int k = L->coordinate, moves = k >= 0, b = l + 1, parent = L->parent, slides = L->slides;
        const df_real x = moves ? q[k] : 0, v = moves ? dq[k] : 0, u = moves ? ddq[k] : 0, *m = BODIES[set][l];
        const df_real C = slides ? 1 : cos(x), S = slides ? 0 : sin(x), z[3] = {0, 0, 1}, h[3] = {m[1], m[2], m[3]};
        const df_real I[3][3] = {{m[4], m[5], m[6]}, {m[5], m[7], m[8]}, {m[6], m[8], m[9]}};
        df_real of[3], turn[3] = {0}, spin[3] = {0};
        FOR(i, 3) {
            R[l][i][0] = C * L->T[i][0] + S * L->T[i][1], R[l][i][1] = C * L->T[i][1] - S * L->T[i][0];
            R[l][i][2] = L->T[i][2], r[l][i] = L->T[i][3] + slides * x * L->T[i][2], of[i] = a[parent][i];
        }
        accelerate(w[parent], e[parent], r[l], of);
        FOR(i, 3) FOR(j, 3) w[b][i] += R[l][j][i] * w[parent][j], e[b][i] += R[l][j][i] * e[parent][j], a[b][i] += R[l][j][i] * of[j];
        cross(w[b], z, turn);
        FOR(i, 3) if (slides) a[b][i] += 2 * v * turn[i] + u * z[i];
        else e[b][i] += v * turn[i] + u * z[i], w[b][i] += v * z[i];
        FOR(i, 3) f[b][i] = m[0] * a[b][i];
        accelerate(w[b], e[b], h, f[b]);
        FOR(i, 3) FOR(j, 3) spin[i] += I[i][j] * w[b][j], n[b][i] += I[i][j] * e[b][j];
        cross(h, a[b], n[b]), cross(w[b], spin, n[b]);
    }
    for (int l = LINKS - 1; l >= 0; l--) {
        df_real force[3] = {0}, *f_parent = f[CHAIN[l].parent], *n_parent = n[CHAIN[l].parent];
        if (CHAIN[l].coordinate == row) tau += CHAIN[l].slides ? f[l + 1][2] : n[l + 1][2];
        FOR(i, 3) FOR(j, 3) force[i] += R[l][i][j] * f[l + 1][j], n_parent[i] += R[l][i][j] * n[l + 1][j];
        FOR(i, 3) f_parent[i] += force[i];
        cross(r[l], force, n_parent);
    }
    return tau;
}
static df_status check(int j, const df_real *q, const df_real *dq, const df_real *ddq) {
    df_status status = DF_OK;
    if (j < 0 || j >= DF_JOINTS) return DF_BAD_INPUT;
    FOR(i, DF_COORDINATES) if ((i == MODEL[j].row || MODEL[j].set >= 0) && !isfinite(q[i] + dq[i] + ddq[i])) return DF_BAD_INPUT;
    FOR(i, DF_JOINTS) if (i == j || MODEL[j].set >= 0) {
        const df_real x[2] = {q[MODEL[i].row], dq[MODEL[i].row]};
        FOR(k, 2) if (x[k] < MODEL[i].range[k][0] || x[k] > MODEL[i].range[k][1]) status = DF_OUTSIDE_VALIDITY;
    }
    return status;
}
df_status df_inertia(int j, const df_real *q, df_real *M) {
    GUARD(q, STILL, STILL)
    df_real unit[DF_COORDINATES] = {0};
    unit[m->row] = 1;
    *M = m->set >= 0 ? links_effort(m->set, m->row, q, STILL, unit, 0) : 0;
    FOR(i, m->terms) *M += m->term[i].value * m->term[i].ddq;
    return status;
}
df_status df_effort(int j, const df_state *s, const df_real *q, const df_real *dq, const df_real *ddq, df_real *tau) {
    GUARD(q, dq, ddq)
    const int k = m->row;
    *tau = m->set >= 0 ? links_effort(m->set, k, q, dq, ddq, GRAVITY) : 0;
    FOR(i, m->terms) *tau += m->term[i].value * phi(&m->term[i], s->z[i], q[k], dq[k], ddq[k]);
    return status;
}
df_status df_bias(int j, const df_state *s, const df_real *q, const df_real *dq, df_real *tau) { return df_effort(j, s, q, dq, STILL, tau); }

df_status df_gravity(int j, const df_real *q, df_real *tau) {
    const df_state still = {0, 0, 0, 0, {0}, {0}};
    const df_status status = df_effort(j, &still, q, STILL, STILL, tau);
    if (status != DF_BAD_INPUT) *tau = limited(*tau, MODEL[j].range[2][0], MODEL[j].range[2][1]);
    return status;
}
df_status df_friction(int j, const df_state *s, const df_real *q, const df_real *dq, df_real *tau) {
    GUARD(q, dq, STILL)
    const df_real v = dq[m->row];
    df_real against = 0; /* friction against the motion, minus the errors of all terms as if they were one */
    FOR(i, m->terms) if (m->term[i].friction) {
        const df_real x = phi(&m->term[i], s->z[i], q[m->row], v, 0);
        against += sign(v) * m->term[i].value * x - (x == 0 ? 0 : m->term[i].std * fabs(x));
    }
    *tau = sign(v) * limited(fmax(against, 0), m->range[2][0], m->range[2][1]);
    return status;
}

/* x = [q, dq, tau_ext] and the upper half of P, row by row; Joseph form: P = (I - K H) P (I - K H)' + K R K'. */
static void correct(const Joint *m, df_real *x, const df_real *y) {
    const df_real P[3][3] = {{x[3], x[4], x[5]}, {x[4], x[6], x[7]}, {x[5], x[7], x[8]}}, i[2] = {y[0] - x[0], y[1] - x[1]};
    const df_real s = P[0][0] + m->R[0], u = P[1][1] + m->R[1], det = s * u - P[0][1] * P[0][1];
    df_real K[3][2], A[3][3], B[3][3], *out = x + 3;
    FOR(a, 3) {
        K[a][0] = (P[a][0] * u - P[a][1] * P[0][1]) / det, K[a][1] = (P[a][1] * s - P[a][0] * P[0][1]) / det;
        x[a] += K[a][0] * i[0] + K[a][1] * i[1];
        FOR(b, 3) A[a][b] = (a == b) - (b < 2 ? K[a][b] : 0);
    }
    FOR(a, 3) FOR(b, 3) B[a][b] = A[a][0] * P[0][b] + A[a][1] * P[1][b] + (a == 2) * P[2][b];
    FOR(a, 3) for (int b = a; b < 3; b++)
        *out++ = B[a][0] * A[b][0] + B[a][1] * A[b][1] + (b == 2) * B[a][2] + K[a][0] * m->R[0] * K[b][0] + K[a][1] * m->R[1] * K[b][1];
}

/* x + T f + T^2/2 A f with f = [dq, (drive - b) / M, 0], and P = F P F' + Q with F = I + T A + T^2/2 A^2. */
static void predict(const Joint *m, df_real *x, df_real drive, df_real M) {
    const df_real P[3][3] = {{x[3], x[4], x[5]}, {x[4], x[6], x[7]}, {x[5], x[7], x[8]}}, q = x[0], dq = x[1];
    const df_real h = 0.5 * T * T, sure = erf(dq / sqrt(2 * x[6] + 1e-300));
    df_real c[6] = {0}, B[3][3], *out = x + 3;
    FOR(i, m->terms) for (int k = m->set >= 0 ? 4 : 0; k < 6; k++) c[k] += m->term[i].value * m->term[i].c[k];
    const df_real A_q = -(c[1] * cos(q) - c[2] * sin(q) + c[3]) / M, A_dq = -c[4] / M, v = T + h * A_dq, d = T * c[5] / M;
    const df_real ddq = (drive - c[0] - c[1] * sin(q) - c[2] * cos(q) - c[3] * q - c[4] * dq - c[5] * sure - x[2]) / M;
    const df_real F[3][3] = {{1 + h * A_q, v, -h / M}, {v * A_q, 1 + v * A_dq + h * A_q, -v / M}, {0, 0, 1}};
    x[0] += T * dq + h * ddq, x[1] += T * ddq + h * (A_q * dq + A_dq * ddq);
    FOR(a, 3) FOR(b, 3) B[a][b] = F[a][0] * P[0][b] + F[a][1] * P[1][b] + F[a][2] * P[2][b];
    FOR(a, 3) for (int b = a; b < 3; b++)
        *out++ = B[a][0] * F[b][0] + B[a][1] * F[b][1] + B[a][2] * F[b][2] + m->Q[a][b];
    x[6] += d * d * (1 - sure * sure); /* the sign of Coulomb friction is uncertain near zero velocity */
}
df_status df_step(int j, df_state *s, const df_sample *in, df_result *out) {
    GUARD(in->q, in->dq, in->ddq)
    const df_real y[4] = {in->q_measured, in->dq_measured, in->tau, in->t}, q = in->q[m->row], dq = in->dq[m->row];
    FOR(i, 4) if (!isfinite(y[i]) || (s->runs && in->t <= s->t)) return DF_BAD_INPUT;
    /* pace: mean interval over the period, minus 1.  A gap counts if it follows another, and then as the shortest gap. */
    const double interval = (in->t - s->t) / DF_PERIOD;
    if (s->runs == BEGINS || (s->runs && interval <= GAP)) s->pace += (fmin(interval, GAP) - 1 - s->pace) / MEAN;
    const int other_rate = fabs(s->pace) > TOLERANCE;
    if (!s->runs || other_rate || interval > GAP) {
        const df_state first = {BEGINS, in->t, s->pace, 0, {0}, {y[0], y[1], 0, 1e6 * m->R[0], 0, 0, 1e6 * m->R[1], 0, m->start * m->start}};
        *s = first;
    } else if (s->runs * T <= TRANSIENT) s->runs++;
    if (other_rate) {
        const df_result unknown = {NAN, NAN, NAN, NAN, -1};
        *out = unknown;
        return DF_OTHER_RATE;
    }
    df_real M, known;
    int speed = 0;
    while (speed < 3 && fabs(dq) > m->edge[speed]) speed++;
    df_inertia(j, in->q, &M), df_effort(j, s, in->q, in->dq, in->ddq, &out->tau_hat), correct(m, s->x, y), s->t = in->t;
    out->tau_ext = s->x[2], out->std_filter = sqrt(s->x[8]);
    out->std = fmax(out->std_filter, m->factor[speed] * sqrt(s->x[8] + m->model_variance));
    s->late = s->runs == BEGINS ? out->tau_ext : s->late + fmin(T / fmax(m->lag, T), 1) * (out->tau_ext - s->late);
    out->std = hypot(out->std, fmax(fabs(out->tau_ext - s->late) - out->std, 0)); /* what the lag leaves of a ramp */
    out->contact = m->alarm > 0 && s->runs * T > TRANSIENT ? fabs(out->tau_ext) > m->alarm : -1;
    known = m->set >= 0 ? out->tau_hat - M * in->ddq[m->row] : 0; /* all that `predict` does not compute */
    FOR(i, m->terms) {
        const Term *p = &m->term[i];
        known += p->value * (m->set >= 0 ? -p->c[4] * dq - p->c[5] * sign(dq) : p->c[6] * state(p, s->z[i], q, dq));
        if (p->kind == 1) s->z[i] = sign(dq) - (sign(dq) - s->z[i]) * exp(-fabs(dq) * T / p->scale);
    }
    predict(m, s->x, in->tau - known, M);
    return status;
}
