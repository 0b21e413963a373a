/* Newton's equations of an iteration, interval by interval.

   The unknowns of interval k are y = (x_k, u_k, x_{k+1}, T), its equations J dy = -c, its curvature H. Solved for
   x_{k+1} they say dx_{k+1} = M (dx_k, dT, du_k) + r: what is left is a linear-quadratic regulator over z = (x, T)
   whose end is held by multipliers nu. Backwards,

       V_k(dz; nu) = dz'P dz / 2 + p'dz + nu'(S'dz + s) + nu'G nu / 2,

   where du_k is eliminated by Cholesky's factors of its curvature. With those of -G, and a positive curvature along T
   in the end, they exist where the whole matrix has the inertia of a minimum, and else not (Rao, Wright, Rawlings,
   Application of interior-point methods to model predictive control, JOTA 99, 1998, with Debreu's lemma for the end:
   HELD |dx_N|^2 / 2 changes no step, for x_N is held, and lets curvature be judged on the equations' null space). */

/* Cholesky's factor of -G, S at T, curvature along T: where the sweep ends. */
typedef struct {
    double G[NX][NX], S[NX], curvature;
} End;

/* Place in y of the j-th of (x, T, u). */
static int place(int j) { return j < NX ? j : j == NX ? NY - 1 : j - 1; }

/* dx_{k+1} = M (dx_k, dT, du_k) + r; 0: the equations do not say. */
static int solved_for_next(Stage *s) {
    for (int i = 0; i < NX; i++) {
        for (int j = 0; j < NX; j++) s->LU[i][j] = s->J[i][BLOCK + j];
        for (int j = 0; j < NV; j++) s->M[i][j] = -s->J[i][place(j)];
    }
    if (!lu_factor(s->LU, s->pivot)) return 0;
    lu_solve(s->LU, s->pivot, &s->M[0][0], NV);
    return 1;
}

/* Curvature F along (x, T, u), and S along them, of P and S along (x_{k+1}, T). */
static void pulled_back(const Stage *s, double F[NV][NV], double SM[NV][NX]) {
    double Y[NZ][NV], Z[NX][NV];
    for (int i = 0; i < NZ; i++) {
        for (int j = 0; j < NV; j++) Y[i][j] = 0;
        for (int l = 0; l < NX; l++)
            for (int j = 0; j < NV; j++) Y[i][j] += s->P[i][l] * s->M[l][j];
        Y[i][NX] += s->P[i][NX];
    }
    for (int i = 0; i < NX; i++)
        for (int j = 0; j < NV; j++) Z[i][j] = Y[i][j] + (j == NX ? 0 : 2 * s->B[BLOCK + i][place(j)]);
    for (int i = 0; i < NV; i++) {
        for (int j = 0; j < NV; j++) F[i][j] = i == NX ? Y[NX][j] : 0;
        for (int j = 0; j < NX; j++) SM[i][j] = i == NX ? s->S[NX][j] : 0;
        for (int l = 0; l < NX; l++) {
            for (int j = 0; j < NV; j++) F[i][j] += s->M[l][i] * Z[l][j];
            for (int j = 0; j < NX; j++) SM[i][j] += s->M[l][i] * s->S[l][j];
        }
    }
    for (int i = 0; i < NV; i++)
        for (int j = 0; j <= i; j++) F[i][j] = F[j][i] = (F[i][j] + F[j][i]) / 2 + s->B[place(i)][place(j)];
}

/* Cholesky's factor of the torques' curvature, with as much on its diagonal as a minimum takes: `least`, or ten times as
   much again and again; 0: nothing helps. */
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

/* One interval backwards, from P, S and G (negative) at its end to those at its beginning; 0: no minimum.
   `bent` is what is added to the diagonal of H along (x_k, u_k); `convex`: along u_k where that is no minimum. */
static int stage_factor(Stage *s, double P[NZ][NZ], double S[NZ][NX], double G[NX][NX], const double *bent,
                        double convex) {
    double F[NV][NV], SM[NV][NX];
    if (!solved_for_next(s)) return 0;
    for (int i = 0; i < NX; i++) {
        for (int j = 0; j < NX; j++) P[i][j] += s->B[BLOCK + i][BLOCK + j];
        P[i][NX] += s->B[BLOCK + i][NY - 1], P[NX][i] += s->B[BLOCK + i][NY - 1];
    }
    memcpy(s->P, P, sizeof s->P), memcpy(s->S, S, sizeof s->S);
    pulled_back(s, F, SM);
    for (int i = 0; i < NU; i++) {
        for (int j = 0; j < NU; j++) s->L[i][j] = F[NZ + i][NZ + j];
        s->L[i][i] += bent[NX + i];
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
        P[i][i] += bent[i];
        for (int l = 0; l < NU; l++)
            for (int j = 0; j < NX; j++) G[i][j] += s->Kn[l][i] * s->Kn[l][j];
    }
    return 1;
}

/* The curvature of an interval with that which bounds of its middle add: row by row, so that registers hold a row. */
static void add_bound_hessian(const Program *it, int k) {
    Stage *s = it->stages + k;
    s->B = it->all > it->size ? s->bounded : s->H;
    if (it->all == it->size) return;
    const char *open = it->open + it->size + NX * k;
    const double *bent = it->bent + it->size + NX * k;
    for (int i = 0; i < NY; i++) {
        double row[NY];
        for (int j = 0; j < NY; j++) row[j] = s->H[i][j];
        for (int l = 0; l < NX; l++) {
            double weight = open[l] ? s->Jm[l][i] * bent[l] : 0;
            for (int j = 0; j < NY; j++) row[j] += weight * s->Jm[l][j];
        }
        for (int j = 0; j < NY; j++) s->bounded[i][j] = row[j];
    }
}

/* All intervals; `it->bent` is what is added to the diagonal of H, in the order of the unknowns. 0: no minimum. */
static int factor(const Program *it, End *end) {
    double P[NZ][NZ] = {{0}}, S[NZ][NX] = {{0}}, G[NX][NX] = {{0}}, a[NX];
    for (int i = 0; i < NX; i++) P[i][i] = HELD, S[i][i] = 1;
    for (int k = it->N - 1; k >= 0; k--)
        if (add_bound_hessian(it, k), !stage_factor(it->stages + k, P, S, G, it->bent + BLOCK * k, it->convex)) return 0;
    memcpy(end->G, G, sizeof G), memcpy(end->S, S[NX], sizeof end->S), memcpy(a, end->S, sizeof a);
    if (!cholesky(&end->G[0][0], NX)) return 0;
    forward(&end->G[0][0], NX, a, 1);
    end->curvature = P[NX][NX] + it->bent[it->size - 1];
    for (int i = 0; i < NX; i++) end->curvature += a[i] * a[i];
    return end->curvature > 0;
}

/* Vectors of the sweep backwards: d is the gradient, c the equations. Returns p at x_0, S's constant in s. */
static void sweep_back(const Program *it, const double *d, const double *c, double p[NZ], double s[NX]) {
    for (int k = it->N - 1; k >= 0; k--) {
        Stage *t = it->stages + k;
        double f[NV], q[NZ];
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
                f[i] += (i == NX ? 0 : t->B[place(i)][BLOCK + l] * t->r[l]) + t->M[l][i] * q[l];
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

/* `step` without its slacks: those unknowns and rows alone. */
static void step_without_slacks(const Program *it, const End *end, const double *d, const double *c, double *dw,
                                double *dlam) {
    double p[NZ] = {0}, b[NX] = {0}, a[NX], nu[NX], v[NV] = {0}, gradient;
    sweep_back(it, d, c, p, b);
    memcpy(a, end->S, sizeof a);
    forward(&end->G[0][0], NX, a, 1), forward(&end->G[0][0], NX, b, 1);
    gradient = p[NX] + d[it->size - 1];
    for (int i = 0; i < NX; i++) gradient += a[i] * b[i];
    v[NX] = dw[it->size - 1] = -gradient / end->curvature;
    for (int i = 0; i < NX; i++) nu[i] = a[i] * v[NX] + b[i];
    backward(&end->G[0][0], NX, nu);
    for (int k = 0; k < it->N; k++) {
        Stage *t = it->stages + k;
        double *u = v + NZ, next[NX], *lam = dlam + NX * k;
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
            for (int j = 0; j < NV; j++) lam[i] -= j == NX ? 0 : t->B[BLOCK + i][place(j)] * v[j];
        }
        lu_transposed(t->LU, t->pivot, lam);
        memcpy(dw + BLOCK * k, v, NX * sizeof *v), memcpy(dw + BLOCK * k + NX, u, NU * sizeof *u);
        memcpy(v, next, sizeof next);
    }
    memset(dw + BLOCK * it->N, 0, NX * sizeof *dw); /* x_N is held */
}

/* The step: (H + bent) dw + J'dlam = -d and J dw = -c. Of a slack, whose row is Jm dw - ds = -e, that leaves
   ds = Jm dw + e and dlam = bent ds + d, and to the others Jm'(bent e + d). */
static void step(const Program *it, const End *end, const double *d, const double *c, double *dw, double *dlam) {
    if (it->all == it->size) {
        step_without_slacks(it, end, d, c, dw, dlam);
        return;
    }
    const double *bent = it->bent + it->size, *e = c + it->equations, *gradient = d + it->size;
    memcpy(it->reduced, d, it->size * sizeof *d);
    for (int k = 0; k < it->N; k++) {
        double weights[NX];
        for (int i = 0; i < NX; i++)
            weights[i] = it->open[it->size + NX * k + i] ? bent[NX * k + i] * e[NX * k + i] + gradient[NX * k + i] : 0;
        add_transposed(it, k, it->stages[k].Jm, weights, it->reduced);
    }
    step_without_slacks(it, end, it->reduced, c, dw, dlam);
    for (int i = 0; i < it->equations; i++) {
        double *ds = dw + it->size + i, *dnu = dlam + it->equations + i, *row = it->stages[i / NX].Jm[i % NX];
        *ds = *dnu = 0;
        if (!it->open[it->size + i]) continue;
        *ds = e[i] + row[NY - 1] * dw[it->size - 1];
        for (int j = 0; j < NY - 1; j++) *ds += row[j] * dw[BLOCK * (i / NX) + j];
        *dnu = bent[i] * *ds + gradient[i];
    }
}
