/* The method's state, its barrier and its filter. Equations' numbers are those of Waechter and Biegler, On the
   implementation of an interior-point filter line-search algorithm, Math. Program. 106, 2006; constants are IPOPT's. */

enum { FILTER = 256 /* pairs that are kept; beyond that the last gives way */ };

/* Where a solve stands: unknowns w (slacks last), multipliers lam of the equations and zl, zu of the bounds, and what
   is there. */
typedef struct {
    Program it;
    End end;
    const double *lower, *upper;
    double *w, *lam, *zl, *zu, *gradient, *c;
    double *d, *dw, *dlam, *dzl, *dzu;               /* the step */
    double *trial, *trial_c, *other_c, *other_dw, *other_dlam; /* what the line search tries */
    double *best_w, *best_lam, *best_zl, *best_zu, closest, closest_mu; /* the best iterate, where E_0 is small */
    double cost, theta, mu, last;                           /* theta: sum of |c|; last: what was added to H last */
    double least_theta, most_theta, descent, phi;             /* of the search: phi is the barrier function */
    double filter[FILTER][2];
    double watched_mu, watched_phi; /* where it was last asked whether phi still falls */
    int filtered, watched;
} Solve;

static double absolute_sum(const double *a, int n) {
    double sum = 0;
    for (int i = 0; i < n; i++) sum += fabs(a[i]);
    return sum;
}

/* The barrier function (3a) at w, where the cost is known. */
static double barrier_function(const Solve *s, const double *w, double cost) {
    double sum = 0, product = 1;
    for (int i = 0; i < s->it.all; i++) {
        if (!s->it.open[i]) continue;
        if (isfinite(s->lower[i])) product *= w[i] - s->lower[i];
        if (isfinite(s->upper[i])) product *= s->upper[i] - w[i];
        if (!(product > 1e-100 && product < 1e100)) sum -= log(product), product = 1; /* logarithms take long */
    }
    return cost + s->mu * (sum - log(product));
}

/* How far along dw the bounds let go (15a). */
static double longest(const Solve *s, const double *dw, double tau) {
    double alpha = 1;
    for (int i = 0; i < s->it.all; i++) {
        if (!s->it.open[i]) continue;
        if (dw[i] < 0 && isfinite(s->lower[i])) alpha = smaller(alpha, -tau * (s->w[i] - s->lower[i]) / dw[i]);
        if (dw[i] > 0 && isfinite(s->upper[i])) alpha = smaller(alpha, tau * (s->upper[i] - s->w[i]) / dw[i]);
    }
    return alpha;
}

/* How far their multipliers let go (15b). */
static double longest_dual(const Solve *s, double tau) {
    double alpha = 1;
    for (int i = 0; i < s->it.all; i++) {
        if (s->dzl[i] < 0) alpha = smaller(alpha, -tau * s->zl[i] / s->dzl[i]);
        if (s->dzu[i] < 0) alpha = smaller(alpha, -tau * s->zu[i] / s->dzu[i]);
    }
    return alpha;
}

static int filter_lets_through(const Solve *s, double theta, double phi) {
    for (int i = 0; i < s->filtered; i++)
        if (theta >= s->filter[i][0] && phi >= s->filter[i][1]) return 0;
    return 1;
}

/* Where it stands, and all that is worse, is not to be come back to (22). */
static void into_filter(Solve *s) {
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

/* The trial at w + length dw: its cost and equations; 0: no numbers. */
static int tried(Solve *s, const double *dw, double length, double *cost, double *theta, double *phi) {
    for (int i = 0; i < s->it.all; i++) s->trial[i] = s->w[i] + (s->it.open[i] ? length * dw[i] : 0);
    if (!evaluate(&s->it, s->trial, cost, s->trial_c, NULL)) return 0;
    *theta = absolute_sum(s->trial_c, s->it.rows);
    *phi = barrier_function(s, s->trial, *cost);
    return 1;
}

/* Whether a trial will do, section 2.3; where it is no step of the cost the filter takes the old one in. */
static int accepted(Solve *s, double alpha, double theta, double phi) {
    double rise = phi - s->phi, rounding = 10 * 2.2e-16 * fabs(s->phi);
    int descends = s->descent < 0 && s->theta <= s->least_theta && alpha * pow(-s->descent, 2.3) > pow(s->theta, 1.1);
    if (!(theta <= s->most_theta)) return 0;
    if (descends) {
        if (!(rise - rounding <= 1e-8 * alpha * s->descent)) return 0;
    } else {
        if (rise > 0 && log10(rise) > larger(1, log10(larger(fabs(s->phi), 10))) + 5) return 0;
        if (!(theta <= (1 - 1e-5) * s->theta || rise - rounding <= -1e-8 * s->theta)) return 0;
    }
    if (!filter_lets_through(s, theta, phi)) return 0;
    if (!descends) into_filter(s);
    return 1;
}

/* Second-order corrections of a step that the equations' curvature has spoiled, section 2.4. */
static int corrected(Solve *s, double tau, double alpha, double theta, double *cost) {
    double length = alpha, before, phi;
    memcpy(s->other_c, s->c, s->it.rows * sizeof *s->c);
    for (int round = 0; round < 4; round++) {
        before = theta;
        for (int i = 0; i < s->it.rows; i++) s->other_c[i] = length * s->other_c[i] + s->trial_c[i];
        step(&s->it, &s->end, s->d, s->other_c, s->other_dw, s->other_dlam);
        length = longest(s, s->other_dw, tau);
        if (!tried(s, s->other_dw, length, cost, &theta, &phi)) return 0;
        if (accepted(s, alpha, theta, phi)) return 1;
        if (theta > 0.99 * before) return 0;
    }
    return 0;
}

/* As far as the bounds allow, with no questions asked but for numbers. */
static int whole_step(Solve *s, double tau, double *alpha, double *cost) {
    double theta, phi;
    *alpha = longest(s, s->dw, tau);
    return tried(s, s->dw, *alpha, cost, &theta, &phi);
}

/* The line search: 1: trial, its equations and cost, and alpha, the multipliers' part of their step; 0: none. */
static int line_search(Solve *s, double tau, double *alpha, double *cost) {
    double shortest = 1e-5, theta, phi;
    int first = 1;
    if (s->descent < 0) {
        shortest = smaller(shortest, 1e-8 * s->theta / -s->descent);
        if (s->theta <= s->least_theta) shortest = smaller(shortest, pow(s->theta, 1.1) / pow(-s->descent, 2.3));
    }
    for (*alpha = longest(s, s->dw, tau); first || *alpha > 0.05 * shortest; *alpha /= 2, first = 0) {
        if (!tried(s, s->dw, *alpha, cost, &theta, &phi)) continue;
        if (accepted(s, *alpha, theta, phi)) return 1;
        if (first && theta >= s->theta && corrected(s, tau, *alpha, theta, cost)) return 1;
    }
    return 0;
}
