/* Values and derivatives of all intervals, LANES at a time.

   Generated before this file: JOINTS, LANES, the type V of LANES doubles, and the functions of one interval in V (see
   `mesh/stages.py`): y = (x_k, u_k, x_{k+1}, T) are its unknowns, p its parameters. The program's unknowns are
   w = (x_0, u_0, x_1, ..., x_N, T) and, if the states in the intervals' middles are bounded, slacks s with the rows
   m(w) - s = 0 after the equations of motion. A slack without bounds is fixed to zero, and so is its row. */

/* Stage: derivatives of an interval, and their factors by `riccati.c`; small, as fine meshes exceed the cache. */
typedef struct {
    double H[NY * (NY + 1) / 2], Jm[NX][NY]; /* Hessian, lower triangle row by row; Jacobian of the middle */
    double LU[NX][NX], M[NX][NV];            /* Jacobian J of the equations, solved for x_{k+1} */
    double across[NX][NV]; /* Hessian's block of x_{k+1} and (x_k, T, u_k), without T */
    double P[NZ][NZ], S[NZ][NX], L[NU][NU], K[NU][NZ], Kn[NU][NX];
    double r[NX], p[NZ], k[NU];
    int pivot[NX], regular; /* regular: 0 where J is singular in x_{k+1} */
} Stage;

/* Program: sizes, parameters, and derivatives at the present iterate. */
typedef struct {
    int N, size, equations, all, rows; /* unknowns and equations, without and with slacks */
    const char *is_free;               /* whether an unknown is free */
    const double *parameters;          /* fractions of the N intervals, then common ones */
    Stage *stages;
    double *sigma, *reduced;           /* diagonal added to H; workspace for a gradient */
    double convex;                     /* least inertia correction of an interval's torques alone; 0: none */
} Program;

/* Unknowns and parameters of LANES intervals; the last interval is repeated beyond the end. */
static void gather(const Program *nlp, const double *w, int first, V y[NY], V p[PARAMETERS]) {
    for (int j = 1; j < PARAMETERS; j++) p[j] = broadcast(nlp->parameters[nlp->N + j - 1]);
    for (int lane = 0; lane < LANES; lane++) {
        int k = first + lane < nlp->N ? first + lane : nlp->N - 1;
        for (int j = 0; j < NY - 1; j++) y[j][lane] = w[BLOCK * k + j];
        y[NY - 1][lane] = w[nlp->size - 1], p[0][lane] = nlp->parameters[k];
    }
}

/* Cost, equations c including the slacks', and states in the middles unless NULL; 0: not finite. */
static int evaluate(const Program *nlp, const double *w, double *cost, double *c, double *middles) {
    V y[NY], p[PARAMETERS], x[NX], left[NU], mid[NU], right[NU], out[NX + 1];
    double sum = 0, total = 0;
    for (int first = 0; first < nlp->N; first += LANES) {
        gather(nlp, w, first, y, p);
        rate(y, y + NX, p, left), rate(y + BLOCK, y + NX, p, right), middle(y, left, right, p, x);
        rate(x, y + NX, p, mid), equations(y, left, mid, right, p, out);
        for (int lane = 0; lane < LANES && first + lane < nlp->N; lane++) {
            for (int j = 0; j < NX; j++) {
                c[NX * (first + lane) + j] = out[j][lane], total += fabs(out[j][lane]);
                if (middles) middles[NX * (first + lane) + j] = x[j][lane];
                if (nlp->all > nlp->size) {
                    int i = NX * (first + lane) + j;
                    c[nlp->equations + i] = nlp->is_free[nlp->size + i] ? x[j][lane] - w[nlp->size + i] : 0;
                }
            }
            sum += out[NX][lane];
        }
    }
    *cost = sum;
    return isfinite(sum) && isfinite(total);
}

/* Index in y of the j-th of (x, T, u). */
static int place(int j) { return j < NX ? j : j == NX ? NY - 1 : j - 1; }

/* M of dx_{k+1} = M (dx_k, dT, du_k) + r, once for all inertia corrections of an iterate. */
static void solve_for_next(Stage *s, double J[NX][NY]) {
    for (int i = 0; i < NX; i++) {
        for (int j = 0; j < NX; j++) s->LU[i][j] = J[i][BLOCK + j];
        for (int j = 0; j < NV; j++) s->M[i][j] = -J[i][place(j)];
    }
    s->regular = lu_factor(s->LU, s->pivot);
    if (s->regular) lu_solve(s->LU, s->pivot, &s->M[0][0], NV);
}

/* out += J'weights for one interval's rows */
static void add_transposed(const Program *nlp, int k, double J[NX][NY], const double *weights, double *out) {
    for (int i = 0; i < NX; i++) {
        for (int j = 0; j < NY - 1; j++) out[BLOCK * k + j] += weights[i] * J[i][j];
        out[nlp->size - 1] += weights[i] * J[i][NY - 1];
    }
}

/* Derivatives of all intervals, the cost's gradient, and that of lam'c; lam includes the middles' multipliers. */
static void differentiate(const Program *nlp, const double *w, const double *lam, double *gradient, double *weighted) {
    V y[NY], p[PARAMETERS], x[NX], l[NX], m[NX], left[NU], mid[NU], right[NU], to_left[NU], to_right[NU];
    V J[JACOBIAN], g[GRADIENT], H[HESSIAN], Jm[MIDDLE];
    V jacobian_left[POINT_JACOBIAN], jacobian_mid[POINT_JACOBIAN], jacobian_right[POINT_JACOBIAN];
    V hessian_left[POINT_HESSIAN], hessian_mid[POINT_HESSIAN], hessian_right[POINT_HESSIAN];
    double jacobian[NX][NY] = {{0}};
    memset(gradient, 0, nlp->all * sizeof *gradient), memset(weighted, 0, nlp->all * sizeof *weighted);
    for (int first = 0; first < nlp->N; first += LANES) {
        gather(nlp, w, first, y, p);
        for (int lane = 0; lane < LANES; lane++)
            for (int j = 0; j < NX; j++) {
                int i = NX * (first + lane < nlp->N ? first + lane : first) + j;
                l[j][lane] = lam[i], m[j][lane] = nlp->all > nlp->size ? lam[nlp->equations + i] : 0;
            }
        rate(y, y + NX, p, left), rate(y + BLOCK, y + NX, p, right), middle(y, left, right, p, x);
        second_order(x, y + NX, l + NU, p, mid, jacobian_mid, hessian_mid), weigh(y, jacobian_mid, l, m, p, to_left, to_right);
        second_order(y, y + NX, to_left, p, left, jacobian_left, hessian_left);
        second_order(y + BLOCK, y + NX, to_right, p, right, jacobian_right, hessian_right);
        assemble(y, l, m, left, jacobian_left, hessian_left, mid, jacobian_mid, hessian_mid, right, jacobian_right, hessian_right,
                 p, J, g, H, Jm);
        for (int lane = 0; lane < LANES && first + lane < nlp->N; lane++) {
            int k = first + lane;
            Stage *s = nlp->stages + k;
            for (int i = 0; i < JACOBIAN; i++) (&jacobian[0][0])[jacobian_place[i]] = J[i][lane];
            for (int i = 0; i < MIDDLE; i++) (&s->Jm[0][0])[middle_place[i]] = Jm[i][lane];
            for (int i = 0; i < HESSIAN; i++) s->H[hessian_place[i]] = H[i][lane];
            for (int i = 0; i < GRADIENT; i++)
                gradient[gradient_place[i] == NY - 1 ? nlp->size - 1 : BLOCK * k + gradient_place[i]] += g[i][lane];
            solve_for_next(s, jacobian), add_transposed(nlp, k, jacobian, lam + NX * k, weighted);
            if (nlp->all > nlp->size) add_transposed(nlp, k, s->Jm, lam + nlp->equations + NX * k, weighted);
        }
    }
    for (int i = nlp->equations; i < nlp->rows; i++) weighted[nlp->size + i - nlp->equations] = -lam[i];
}

/* Set all Hessians to zero. */
static void clear_hessians(const Program *nlp) {
    for (int k = 0; k < nlp->N; k++) memset(nlp->stages[k].H, 0, sizeof nlp->stages[k].H);
}
