/* Riccati recursion for the Newton equations, stage by stage.

   Interval k has the unknowns y = (x_k, u_k, x_{k+1}, T), the linearised equations J dy = -c and the Hessian H. Solving
   for x_{k+1} gives dx_{k+1} = M (dx_k, dT, du_k) + r, a linear-quadratic regulator over z = (x, T) with the terminal
   condition dx_N = 0, whose multipliers are nu. The value function is, backwards,

       V_k(dz; nu) = dz'P dz / 2 + p'dz + nu'(S'dz + s) + nu'G nu / 2,

   where du_k is eliminated by a Cholesky factorization of its Hessian. These factors, that of -G, and a positive Schur
   complement of T exist if and only if the KKT matrix has the inertia of a minimum (Rao, Wright, Rawlings, Application
   of interior-point methods to model predictive control, JOTA 99, 1998; with Debreu's lemma at the end:
   HELD |dx_N|^2 / 2 leaves the step, as dx_N = 0, and restricts the test to the equations' null space). */

/* Read a part of a stage into the cache, ahead of its use: fine meshes are larger than the cache. */
static inline void prefetch(const void *first, const void *end) {
    for (const char *at = first; at < (const char *)end; at += 64) __builtin_prefetch(at);
}

/* Result of the recursion at k = 0: Cholesky factor of -G, row of S for T, Schur complement of T. */
typedef struct {
    double G[NX][NX], S[NX], curvature;
} End;

/* Stage Hessian F and row SM in (x, T, u), from P and S in (x_{k+1}, T). */
static void pull_back(const Stage *s, const double B[NY][NY], double F[NV][NV], double SM[NV][NX]) {
    double Y[NZ][NV], Z[NX][NV];
    for (int i = 0; i < NZ; i++) {
        for (int j = 0; j < NV; j++) Y[i][j] = 0;
        for (int l = 0; l < NX; l++)
            for (int j = 0; j < NV; j++) Y[i][j] += s->P[i][l] * s->M[l][j];
        Y[i][NX] += s->P[i][NX];
    }
    for (int i = 0; i < NX; i++)
        for (int j = 0; j < NV; j++) Z[i][j] = Y[i][j] + (j == NX ? 0 : 2 * B[BLOCK + i][place(j)]);
    for (int i = 0; i < NV; i++) {
        for (int j = 0; j < NV; j++) F[i][j] = i == NX ? Y[NX][j] : 0;
        for (int j = 0; j < NX; j++) SM[i][j] = i == NX ? s->S[NX][j] : 0;
        for (int l = 0; l < NX; l++) {
            for (int j = 0; j < NV; j++) F[i][j] += s->M[l][i] * Z[l][j];
            for (int j = 0; j < NX; j++) SM[i][j] += s->M[l][i] * s->S[l][j];
        }
    }
    for (int i = 0; i < NV; i++)
        for (int j = 0; j <= i; j++) F[i][j] = F[j][i] = (F[i][j] + F[j][i]) / 2 + B[place(i)][place(j)];
}

/* Cholesky factor of the torques' Hessian, with an inertia correction of `least` times a power of ten if needed; 0: the
   correction is too large. */
static int factor_convex(double L[NU][NU], double least) {
    double own[NU][NU];
    memcpy(own, L, sizeof own);
    for (double more = least; !cholesky(&L[0][0], NU); more *= 10) {
        if (!(more > 0 && more < 1e6)) return 0;
        memcpy(L, own, sizeof own);
        for (int i = 0; i < NU; i++) L[i][i] += more;
    }
    return 1;
}

/* One stage of the recursion: P, S and -G from the end of an interval to its start; 0: wrong inertia.
   `sigma`: diagonal added to H for (x_k, u_k); `convex`: least inertia correction of u_k. */
static int stage_factor(Stage *s, const double B[NY][NY], double P[NZ][NZ], double S[NZ][NX], double G[NX][NX], const double *sigma,
                        double convex) {
    double F[NV][NV], SM[NV][NX];
    if (!s->regular) return 0;
    for (int i = 0; i < NX; i++) {
        for (int j = 0; j < NX; j++) P[i][j] += B[BLOCK + i][BLOCK + j];
        P[i][NX] += B[BLOCK + i][NY - 1], P[NX][i] += B[BLOCK + i][NY - 1];
        for (int j = 0; j < NV; j++) s->across[i][j] = j == NX ? 0 : B[BLOCK + i][place(j)];
    }
    memcpy(s->P, P, sizeof s->P), memcpy(s->S, S, sizeof s->S);
    pull_back(s, B, F, SM);
    for (int i = 0; i < NU; i++) {
        for (int j = 0; j < NU; j++) s->L[i][j] = F[NZ + i][NZ + j];
        s->L[i][i] += sigma[NX + i];
        for (int j = 0; j < NZ; j++) s->K[i][j] = F[NZ + i][j];
        for (int j = 0; j < NX; j++) s->Kn[i][j] = SM[NZ + i][j];
    }
    if (!factor_convex(s->L, convex)) return 0;
    forward(&s->L[0][0], NU, &s->K[0][0], NZ);
    forward(&s->L[0][0], NU, &s->Kn[0][0], NX);
    for (int i = 0; i < NZ; i++) {
        for (int j = 0; j < NZ; j++) P[i][j] = F[i][j];
        for (int j = 0; j < NX; j++) S[i][j] = SM[i][j];
        for (int l = 0; l < NU; l++) {
            for (int j = 0; j < NZ; j++) P[i][j] -= s->K[l][i] * s->K[l][j];
            for (int j = 0; j < NX; j++) S[i][j] -= s->K[l][i] * s->Kn[l][j];
        }
    }
    for (int i = 0; i < NX; i++) {
        P[i][i] += sigma[i];
        for (int l = 0; l < NU; l++)
            for (int j = 0; j < NX; j++) G[i][j] += s->Kn[l][i] * s->Kn[l][j];
    }
    return 1;
}

/* Hessian B of an interval with the barrier terms of its middle's bounds: row by row, to keep a row in registers. */
static void bounded_hessian(const Program *nlp, int k, double B[NY][NY]) {
    const Stage *s = nlp->stages + k;
    for (int i = 0, at = 0; i < NY; i++)
        for (int j = 0; j <= i; j++) B[i][j] = B[j][i] = s->H[at++];
    if (nlp->all == nlp->size) return;
    const char *is_free = nlp->is_free + nlp->size + NX * k;
    const double *sigma = nlp->sigma + nlp->size + NX * k;
    for (int i = 0; i < NY; i++) {
        double row[NY];
        for (int j = 0; j < NY; j++) row[j] = B[i][j];
        for (int l = 0; l < NX; l++) {
            double weight = is_free[l] ? s->Jm[l][i] * sigma[l] : 0;
            for (int j = 0; j < NY; j++) row[j] += weight * s->Jm[l][j];
        }
        for (int j = 0; j < NY; j++) B[i][j] = row[j];
    }
}

/* Factorization over all intervals; `nlp->sigma`: diagonal added to H. 0: wrong inertia. */
static int factor(const Program *nlp, End *end) {
    double B[NY][NY], P[NZ][NZ] = {{0}}, S[NZ][NX] = {{0}}, G[NX][NX] = {{0}}, a[NX];
    for (int i = 0; i < NX; i++) P[i][i] = HELD, S[i][i] = 1;
    for (int k = nlp->N - 1; k >= 0; k--) {
        if (k) prefetch(nlp->stages[k - 1].H, nlp->stages[k - 1].across);
        bounded_hessian(nlp, k, B);
        if (!stage_factor(nlp->stages + k, B, P, S, G, nlp->sigma + BLOCK * k, nlp->convex)) return 0;
    }
    memcpy(end->G, G, sizeof G), memcpy(end->S, S[NX], sizeof end->S), memcpy(a, end->S, sizeof a);
    if (!cholesky(&end->G[0][0], NX)) return 0;
    forward(&end->G[0][0], NX, a, 1);
    end->curvature = P[NX][NX] + nlp->sigma[nlp->size - 1];
    for (int i = 0; i < NX; i++) end->curvature += a[i] * a[i];
    return end->curvature > 0;
}

/* Backward sweep of the vectors: d: gradient, c: equations. Returns p at x_0, and the constant s. */
static void sweep_back(const Program *nlp, const double *d, const double *c, double p[NZ], double s[NX]) {
    for (int k = nlp->N - 1; k >= 0; k--) {
        Stage *t = nlp->stages + k;
        double f[NV], q[NZ];
        if (k) prefetch(t[-1].LU, t[-1].r);
        memcpy(t->p, p, sizeof t->p);
        for (int i = 0; i < NX; i++) t->r[i] = -c[NX * k + i];
        lu_solve(t->LU, t->pivot, t->r, 1);
        for (int i = 0; i < NZ; i++) {
            q[i] = p[i];
            for (int l = 0; l < NX; l++) q[i] += t->P[i][l] * t->r[l];
        }
        for (int i = 0; i < NV; i++) {
            f[i] = i == NX ? q[NX] : 0;
            for (int l = 0; l < NX; l++)
                f[i] += t->across[l][i] * t->r[l] + t->M[l][i] * q[l];
            if (i != NX) f[i] += d[BLOCK * k + place(i)];
        }
        for (int l = 0; l < NX; l++)
            for (int j = 0; j < NX; j++) s[j] += t->S[l][j] * t->r[l];
        memcpy(t->k, f + NZ, sizeof t->k), memcpy(p, f, NZ * sizeof *p);
        forward(&t->L[0][0], NU, t->k, 1);
        for (int l = 0; l < NU; l++) {
            for (int i = 0; i < NZ; i++) p[i] -= t->K[l][i] * t->k[l];
            for (int i = 0; i < NX; i++) s[i] -= t->Kn[l][i] * t->k[l];
        }
    }
}

/* Step of the unknowns and rows without the slacks, by a forward sweep. */
static void step_without_slacks(const Program *nlp, const End *end, const double *d, const double *c, double *dw,
                                double *dlam) {
    double p[NZ] = {0}, b[NX] = {0}, a[NX], nu[NX], v[NV] = {0}, gradient;
    sweep_back(nlp, d, c, p, b);
    memcpy(a, end->S, sizeof a);
    forward(&end->G[0][0], NX, a, 1), forward(&end->G[0][0], NX, b, 1);
    gradient = p[NX] + d[nlp->size - 1];
    for (int i = 0; i < NX; i++) gradient += a[i] * b[i];
    v[NX] = dw[nlp->size - 1] = -gradient / end->curvature;
    for (int i = 0; i < NX; i++) nu[i] = a[i] * v[NX] + b[i];
    backward(&end->G[0][0], NX, nu);
    for (int k = 0; k < nlp->N; k++) {
        Stage *t = nlp->stages + k;
        double *u = v + NZ, next[NX], *lam = dlam + NX * k;
        if (k + 1 < nlp->N) prefetch(t[1].LU, t[1].pivot);
        for (int i = 0; i < NU; i++) {
            u[i] = -t->k[i];
            for (int j = 0; j < NZ; j++) u[i] -= t->K[i][j] * v[j];
            for (int j = 0; j < NX; j++) u[i] -= t->Kn[i][j] * nu[j];
        }
        backward(&t->L[0][0], NU, u);
        for (int i = 0; i < NX; i++) {
            next[i] = t->r[i];
            for (int j = 0; j < NV; j++) next[i] += t->M[i][j] * v[j];
        }
        for (int i = 0; i < NX; i++) {
            lam[i] = -t->p[i] - t->P[i][NX] * v[NX];
            for (int j = 0; j < NX; j++) lam[i] -= t->P[i][j] * next[j] + t->S[i][j] * nu[j];
            for (int j = 0; j < NV; j++) lam[i] -= t->across[i][j] * v[j];
        }
        lu_transposed(t->LU, t->pivot, lam);
        memcpy(dw + BLOCK * k, v, NX * sizeof *v), memcpy(dw + BLOCK * k + NX, u, NU * sizeof *u);
        memcpy(v, next, sizeof next);
    }
    memset(dw + BLOCK * nlp->N, 0, NX * sizeof *dw); /* x_N is fixed */
}

/* Step: (H + sigma) dw + J'dlam = -d, J dw = -c. Slacks with rows Jm dw - ds = -e are eliminated: ds = Jm dw + e and
   dlam = sigma ds + d, which adds Jm'(sigma e + d) to the gradient of the others. */
static void step(const Program *nlp, const End *end, const double *d, const double *c, double *dw, double *dlam) {
    if (nlp->all == nlp->size) {
        step_without_slacks(nlp, end, d, c, dw, dlam);
        return;
    }
    const double *sigma = nlp->sigma + nlp->size, *e = c + nlp->equations, *gradient = d + nlp->size;
    const char *is_free = nlp->is_free + nlp->size;
    memcpy(nlp->reduced, d, nlp->size * sizeof *d);
    for (int k = 0; k < nlp->N; k++) {
        double weights[NX];
        for (int i = 0; i < NX; i++)
            weights[i] = is_free[NX * k + i] ? sigma[NX * k + i] * e[NX * k + i] + gradient[NX * k + i] : 0;
        add_transposed(nlp, k, nlp->stages[k].Jm, weights, nlp->reduced);
    }
    step_without_slacks(nlp, end, nlp->reduced, c, dw, dlam);
    for (int i = 0; i < nlp->equations; i++) {
        double *ds = dw + nlp->size + i, *dnu = dlam + nlp->equations + i, *row = nlp->stages[i / NX].Jm[i % NX];
        *ds = *dnu = 0;
        if (!is_free[i]) continue;
        *ds = e[i] + row[NY - 1] * dw[nlp->size - 1];
        for (int j = 0; j < NY - 1; j++) *ds += row[j] * dw[BLOCK * (i / NX) + j];
        *dnu = sigma[i] * *ds + gradient[i];
    }
}
