/* Values and derivatives of all intervals, LANES at a time.

   Before this stand JOINTS, LANES, the type V of LANES doubles, and functions of one interval in V, which
   `stagewise.interval` writes: y = (x_k, u_k, x_{k+1}, T) are its unknowns, p its parameters. Unknowns of the program
   are w = (x_0, u_0, x_1, ..., x_N, T) and, where the states in the middle of the intervals have bounds, slacks s that
   equal them: m(w) - s = 0 follows the equations of motion. A slack without bounds is held at zero, as is its row. */

enum {
    NX = 2 * JOINTS,   /* state */
    NU = JOINTS,       /* torque */
    NZ = NX + 1,       /* state and T */
    NV = NX + 1 + NU,  /* what an interval begins with, and its torque: (x, T, u) */
    NY = NV + NX,      /* unknowns of an interval */
    BLOCK = NX + NU    /* from one knot to the next */
};

/* An interval's Jacobian and curvature; what `riccati.c` makes of them. */
typedef struct {
    double J[NX][NY], H[NY][NY], Jm[NX][NY]; /* of the equations; curvature; of the middle */
    double (*B)[NY], bounded[NY][NY];        /* curvature with what the middle's bounds add */
    double LU[NX][NX], M[NX][NV], P[NZ][NZ], S[NZ][NX], L[NU][NU], K[NU][NZ], Kn[NU][NX];
    double r[NX], p[NZ], k[NU];
    int pivot[NX];
} Stage;

/* A program and where it stands. */
typedef struct {
    int N, size, equations, all, rows; /* unknowns and equations, without and with slacks */
    const char *open;                  /* whether an unknown is free */
    const double *parameters; /* fractions of the N intervals, then what all share */
    Stage *stages;
    double *bent, *reduced; /* what is added to the diagonal of H; room for a gradient */
    double convex;          /* at least so much is added along the torques of an interval that has no minimum; 0: none */
} Program;

/* An interval's unknowns and parameters; beyond the last interval, its own again. */
static void gather(const Program *it, const double *w, int first, V y[NY], V p[PARAMETERS]) {
    for (int j = 1; j < PARAMETERS; j++) p[j] = broadcast(it->parameters[it->N + j - 1]);
    for (int lane = 0; lane < LANES; lane++) {
        int k = first + lane < it->N ? first + lane : it->N - 1;
        for (int j = 0; j < NY - 1; j++) y[j][lane] = w[BLOCK * k + j];
        y[NY - 1][lane] = w[it->size - 1], p[0][lane] = it->parameters[k];
    }
}

/* Cost, equations c with those of the slacks, and the states in the middle where they are asked for; 0: no numbers. */
static int evaluate(const Program *it, const double *w, double *cost, double *c, double *middles) {
    V y[NY], p[PARAMETERS], x[NX], left[NU], mid[NU], right[NU], out[NX + 1];
    double sum = 0, total = 0;
    for (int first = 0; first < it->N; first += LANES) {
        gather(it, w, first, y, p);
        rate(y, y + NX, p, left), rate(y + BLOCK, y + NX, p, right), middle(y, left, right, p, x);
        rate(x, y + NX, p, mid), equations(y, left, mid, right, p, out);
        for (int lane = 0; lane < LANES && first + lane < it->N; lane++) {
            for (int j = 0; j < NX; j++) {
                c[NX * (first + lane) + j] = out[j][lane], total += fabs(out[j][lane]);
                if (middles) middles[NX * (first + lane) + j] = x[j][lane];
                if (it->all > it->size) {
                    int i = NX * (first + lane) + j;
                    c[it->equations + i] = it->open[it->size + i] ? x[j][lane] - w[it->size + i] : 0;
                }
            }
            sum += out[NX][lane];
        }
    }
    *cost = sum;
    return isfinite(sum) && isfinite(total);
}

/* Jacobians, curvature of cost + lam'c, and the cost's gradient; lam has weights for the middle, too. */
static void differentiate(const Program *it, const double *w, const double *lam, double *gradient) {
    V y[NY], p[PARAMETERS], x[NX], l[NX], m[NX], left[NU], mid[NU], right[NU], to_left[NU], to_right[NU];
    V J[JACOBIAN], g[GRADIENT], H[HESSIAN], Jm[MIDDLE];
    V jacobian_left[POINT_JACOBIAN], jacobian_mid[POINT_JACOBIAN], jacobian_right[POINT_JACOBIAN];
    V hessian_left[POINT_HESSIAN], hessian_mid[POINT_HESSIAN], hessian_right[POINT_HESSIAN];
    memset(gradient, 0, it->all * sizeof *gradient);
    for (int first = 0; first < it->N; first += LANES) {
        gather(it, w, first, y, p);
        for (int lane = 0; lane < LANES; lane++)
            for (int j = 0; j < NX; j++) {
                int i = NX * (first + lane < it->N ? first + lane : first) + j;
                l[j][lane] = lam[i], m[j][lane] = it->all > it->size ? lam[it->equations + i] : 0;
            }
        rate(y, y + NX, p, left), rate(y + BLOCK, y + NX, p, right), middle(y, left, right, p, x);
        second_order(x, y + NX, l + NU, p, mid, jacobian_mid, hessian_mid), weigh(y, jacobian_mid, l, m, p, to_left, to_right);
        second_order(y, y + NX, to_left, p, left, jacobian_left, hessian_left);
        second_order(y + BLOCK, y + NX, to_right, p, right, jacobian_right, hessian_right);
        assemble(y, l, m, left, jacobian_left, hessian_left, mid, jacobian_mid, hessian_mid, right, jacobian_right, hessian_right,
                 p, J, g, H, Jm);
        for (int lane = 0; lane < LANES && first + lane < it->N; lane++) {
            int k = first + lane;
            double *jacobian = &it->stages[k].J[0][0], *hessian = &it->stages[k].H[0][0];
            double *jm = &it->stages[k].Jm[0][0];
            for (int i = 0; i < JACOBIAN; i++) jacobian[jacobian_place[i]] = J[i][lane];
            for (int i = 0; i < MIDDLE; i++) jm[middle_place[i]] = Jm[i][lane];
            for (int i = 0; i < HESSIAN; i++) hessian[hessian_place[i]] = hessian[hessian_mirror[i]] = H[i][lane];
            for (int i = 0; i < GRADIENT; i++)
                gradient[gradient_place[i] == NY - 1 ? it->size - 1 : BLOCK * k + gradient_place[i]] += g[i][lane];
        }
    }
}

/* out += J'weights of one interval's rows */
static void add_transposed(const Program *it, int k, double J[NX][NY], const double *weights, double *out) {
    for (int i = 0; i < NX; i++) {
        for (int j = 0; j < NY - 1; j++) out[BLOCK * k + j] += weights[i] * J[i][j];
        out[it->size - 1] += weights[i] * J[i][NY - 1];
    }
}

/* out = J'lam */
static void transposed(const Program *it, const double *lam, double *out) {
    memset(out, 0, it->all * sizeof *out);
    for (int k = 0; k < it->N; k++) add_transposed(it, k, it->stages[k].J, lam + NX * k, out);
    if (it->all == it->size) return;
    for (int k = 0; k < it->N; k++) add_transposed(it, k, it->stages[k].Jm, lam + it->equations + NX * k, out);
    for (int i = 0; i < it->equations; i++) out[it->size + i] = -lam[it->equations + i];
}

/* A flat program: none of its curvature is kept. */
static void flatten(const Program *it) {
    for (int k = 0; k < it->N; k++) memset(it->stages[k].H, 0, sizeof it->stages[k].H);
}
