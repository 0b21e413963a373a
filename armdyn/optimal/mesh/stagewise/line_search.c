/* State of the method, barrier function, filter and line search. Equation and section numbers: Waechter and Biegler, On
   the implementation of an interior-point filter line-search algorithm, Math. Program. 106, 2006; IPOPT's constants. */

enum { FILTER = 256 /* largest number of pairs; beyond it the last is replaced */ };

/* Iterate: unknowns w (slacks last), multipliers lam of the equations and zl, zu of the bounds, and values at w. */
typedef struct {
    Program nlp;
    End end;
    const double *lower, *upper;
    double *w, *lam, *zl, *zu, *gradient, *c;
    double *d, *dw, *dlam, *dzl, *dzu;                                  /* step */
    double *trial, *trial_c, *other_c, *other_dw, *other_dlam;          /* trial point and corrections */
    double *best_w, *best_lam, *best_zl, *best_zu, best_error, best_mu; /* best iterate of small E_0 */
    double cost, theta, mu, delta;                /* theta: sum of |c|; delta: last inertia correction */
    double least_theta, most_theta, descent, phi; /* line search; phi: barrier function */
    double filter[FILTER][2];
    double checked_mu, checked_phi;               /* last check of the decrease of phi */
    int filtered, checked_at;
} Solve;

static double absolute_sum(const double *a, int n) {
    double sum = 0;
    for (int i = 0; i < n; i++) sum += fabs(a[i]);
    return sum;
}

/* Barrier function (3a) at w, given the cost. */
static double barrier_function(const Solve *s, const double *w, double cost) {
    double sum = 0, product = 1;
    for (int i = 0; i < s->nlp.all; i++) {
        if (!s->nlp.is_free[i]) continue;
        if (isfinite(s->lower[i])) product *= w[i] - s->lower[i];
        if (isfinite(s->upper[i])) product *= s->upper[i] - w[i];
        if (!(product > 1e-100 && product < 1e100)) sum -= log(product), product = 1; /* logarithms are slow */
    }
    return cost + s->mu * (sum - log(product));
}

/* Largest primal step by the fraction-to-the-boundary rule (15a). */
static double longest_primal(const Solve *s, const double *dw, double tau) {
    double alpha = 1;
    for (int i = 0; i < s->nlp.all; i++) {
        if (!s->nlp.is_free[i]) continue;
        if (dw[i] < 0 && isfinite(s->lower[i])) alpha = smaller(alpha, -tau * (s->w[i] - s->lower[i]) / dw[i]);
        if (dw[i] > 0 && isfinite(s->upper[i])) alpha = smaller(alpha, tau * (s->upper[i] - s->w[i]) / dw[i]);
    }
    return alpha;
}

/* Largest dual step by the fraction-to-the-boundary rule (15b). */
static double longest_dual(const Solve *s, double tau) {
    double alpha = 1;
    for (int i = 0; i < s->nlp.all; i++) {
        if (s->dzl[i] < 0) alpha = smaller(alpha, -tau * s->zl[i] / s->dzl[i]);
        if (s->dzu[i] < 0) alpha = smaller(alpha, -tau * s->zu[i] / s->dzu[i]);
    }
    return alpha;
}

static int filter_accepts(const Solve *s, double theta, double phi) {
    for (int i = 0; i < s->filtered; i++)
        if (theta >= s->filter[i][0] && phi >= s->filter[i][1]) return 0;
    return 1;
}

/* Augment the filter by the present iterate (22), and drop dominated pairs. */
static void augment_filter(Solve *s) {
    double theta = (1 - 1e-5) * s->theta, phi = s->phi - 1e-8 * s->theta;
    int kept = 0;
    for (int i = 0; i < s->filtered; i++)
        if (s->filter[i][0] < theta || s->filter[i][1] < phi) {
            s->filter[kept][0] = s->filter[i][0], s->filter[kept++][1] = s->filter[i][1];
        }
    if (kept == FILTER) kept--;
    s->filter[kept][0] = theta, s->filter[kept][1] = phi;
    s->filtered = kept + 1;
}

/* Trial point w + length dw, its cost, theta and phi; 0: not finite. */
static int try_step(Solve *s, const double *dw, double length, double *cost, double *theta, double *phi) {
    for (int i = 0; i < s->nlp.all; i++) s->trial[i] = s->w[i] + (s->nlp.is_free[i] ? length * dw[i] : 0);
    if (!evaluate(&s->nlp, s->trial, cost, s->trial_c, NULL)) return 0;
    *theta = absolute_sum(s->trial_c, s->nlp.rows);
    *phi = barrier_function(s, s->trial, *cost);
    return 1;
}

/* Acceptance of a trial point, section 2.3; the filter is augmented unless (19) and the Armijo condition (20) hold. */
static int accept(Solve *s, double alpha, double theta, double phi) {
    double rise = phi - s->phi, rounding = 10 * 2.2e-16 * fabs(s->phi);
    int descends = s->descent < 0 && s->theta <= s->least_theta && alpha * pow(-s->descent, 2.3) > pow(s->theta, 1.1);
    if (!(theta <= s->most_theta)) return 0;
    if (descends) {
        if (!(rise - rounding <= 1e-8 * alpha * s->descent)) return 0;
    } else {
        if (rise > 0 && log10(rise) > larger(1, log10(larger(fabs(s->phi), 10))) + 5) return 0;
        if (!(theta <= (1 - 1e-5) * s->theta || rise - rounding <= -1e-8 * s->theta)) return 0;
    }
    if (!filter_accepts(s, theta, phi)) return 0;
    if (!descends) augment_filter(s);
    return 1;
}

/* Second-order corrections of the constraints, section 2.4. */
static int second_order_correction(Solve *s, double tau, double alpha, double theta, double *cost) {
    double length = alpha, before, phi;
    memcpy(s->other_c, s->c, s->nlp.rows * sizeof *s->c);
    for (int round = 0; round < 4; round++) {
        before = theta;
        for (int i = 0; i < s->nlp.rows; i++) s->other_c[i] = length * s->other_c[i] + s->trial_c[i];
        step(&s->nlp, &s->end, s->d, s->other_c, s->other_dw, s->other_dlam);
        length = longest_primal(s, s->other_dw, tau);
        if (!try_step(s, s->other_dw, length, cost, &theta, &phi)) return 0;
        if (accept(s, alpha, theta, phi)) return 1;
        if (theta > 0.99 * before) return 0;
    }
    return 0;
}

/* Largest step within the bounds, without acceptance tests (section 3.9); 0: not finite. */
static int full_step(Solve *s, double tau, double *alpha, double *cost) {
    double theta, phi;
    *alpha = longest_primal(s, s->dw, tau);
    return try_step(s, s->dw, *alpha, cost, &theta, &phi);
}

/* Backtracking line search: 1: trial point with its equations and cost, and alpha, also for lam; 0: step too small. */
static int line_search(Solve *s, double tau, double *alpha, double *cost) {
    double shortest = 1e-5, theta, phi;
    int first = 1;
    if (s->descent < 0) {
        shortest = smaller(shortest, 1e-8 * s->theta / -s->descent);
        if (s->theta <= s->least_theta) shortest = smaller(shortest, pow(s->theta, 1.1) / pow(-s->descent, 2.3));
    }
    for (*alpha = longest_primal(s, s->dw, tau); first || *alpha > 0.05 * shortest; *alpha /= 2, first = 0) {
        if (!try_step(s, s->dw, *alpha, cost, &theta, &phi)) continue;
        if (accept(s, *alpha, theta, phi)) return 1;
        if (first && theta >= s->theta && second_order_correction(s, tau, *alpha, theta, cost)) return 1;
    }
    return 0;
}
