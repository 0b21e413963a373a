/* Primal-dual interior-point method for min f(w), c(w) = 0, lower <= w <= upper, after Waechter and Biegler (source,
   section and equation numbers: see `line_search.c`). Differences: steps by a Riccati recursion instead of a sparse
   factorization, and a simpler restoration phase. */

enum { SOLVED, ACCEPTED, ITERATIONS, STOPPED, RESTORATION_FAILED, INVALID_NUMBER, TINY_STEP, NO_MEMORY };

/* Relative relaxation of the bounds; acceptable level of E_0 of (5), over ACCEPTED_AFTER iterations. */
static const double RELAXED = 1e-8, ACCEPTABLE = 1e-6;
enum { ACCEPTED_AFTER = 15 };

/* Settings: E_0 <= `tolerance` within `iterations`; `barrier`: initial mu. `push`: kappa_1, kappa_2 of section 3.6 for
   a warm start, with bound multipliers mu / distance; 0: IPOPT's constants. The others are additions for joints idle in
   time-optimal motion, along whose torques the Hessian is singular or indefinite. `convex`: least inertia correction of
   an interval's torques alone (0: of all unknowns, section 3.1). mu is also reduced once the barrier function falls by
   at most `still` over `after` iterations. If iterations end so, or without a solution, the best iterate with
   E_0 <= `close` is returned. */
typedef struct {
    double tolerance, barrier, push, close, still, convex;
    int iterations, after;
} Settings;

/* Callback with the state of an iteration; nonzero stops the solve. */
typedef int (*Monitor)(int iteration, double cost, double infeasible, double error, double mu);

/* E_mu (5), with d the gradient of cost + lam'c. Maxima ignore NaN, which the sums detect. */
static double error_of(const Solve *s, double mu) {
    double dual = 0, gaps = 0, equations = 0, z = 0, sum = 0, all;
    int n = 0;
    for (int i = 0; i < s->nlp.all; i++) {
        if (!s->nlp.is_free[i]) continue;
        dual = larger(dual, fabs(s->d[i] - s->zl[i] + s->zu[i])), sum += s->d[i];
        if (isfinite(s->lower[i]))
            gaps = larger(gaps, fabs((s->w[i] - s->lower[i]) * s->zl[i] - mu)), z += s->zl[i], n++;
        if (isfinite(s->upper[i]))
            gaps = larger(gaps, fabs((s->upper[i] - s->w[i]) * s->zu[i] - mu)), z += s->zu[i], n++;
    }
    for (int i = 0; i < s->nlp.rows; i++) equations = larger(equations, fabs(s->c[i]));
    all = absolute_sum(s->lam, s->nlp.rows) + z;
    dual /= larger(100, all / (s->nlp.rows + n)) / 100, gaps /= larger(100, z / n) / 100;
    return isfinite(all) && isfinite(sum) ? larger(larger(dual, equations), gaps) : NAN;
}

/* Factorization with inertia correction, section 3.1; 0: correction too large. Fixed unknowns have 1e30. */
static int factor_corrected(Solve *s) {
    double delta = 0;
    for (int i = 0; i < s->nlp.all; i++) {
        s->nlp.sigma[i] = s->nlp.is_free[i] ? 0 : 1e30;
        if (s->zl[i] > 0) s->nlp.sigma[i] += s->zl[i] / (s->w[i] - s->lower[i]);
        if (s->zu[i] > 0) s->nlp.sigma[i] += s->zu[i] / (s->upper[i] - s->w[i]);
    }
    while (!factor(&s->nlp, &s->end)) {
        double more = delta ? delta * (s->delta ? 8 : 100) : s->delta ? larger(1e-20, s->delta / 3) : 1e-4;
        if (more > 1e20) return 0;
        for (int i = 0; i < s->nlp.all; i++) s->nlp.sigma[i] += more - delta;
        delta = more;
    }
    if (delta) s->delta = delta;
    return 1;
}

/* Least-squares multipliers of the equations, section 3.6; zero if they are large. */
static void multipliers(Solve *s) {
    double largest = 0;
    clear_hessians(&s->nlp);
    for (int i = 0; i < s->nlp.all; i++) {
        s->nlp.sigma[i] = s->nlp.is_free[i] ? 1 : 1e30;
        s->d[i] = s->nlp.is_free[i] ? s->gradient[i] - s->zl[i] + s->zu[i] : 0;
    }
    memset(s->other_c, 0, s->nlp.rows * sizeof *s->c), memset(s->lam, 0, s->nlp.rows * sizeof *s->lam);
    if (!factor(&s->nlp, &s->end)) return;
    step(&s->nlp, &s->end, s->d, s->other_c, s->dw, s->dlam);
    for (int i = 0; i < s->nlp.rows; i++) largest = larger(largest, fabs(s->dlam[i]));
    if (largest <= 1e3) memcpy(s->lam, s->dlam, s->nlp.rows * sizeof *s->lam);
}

/* Accept the trial point: unknowns and multipliers; those of the bounds are reset to the central path (16). */
static void advance(Solve *s, double cost, double alpha, double alpha_dual) {
    double *swap = s->c;
    s->c = s->trial_c, s->trial_c = swap, s->cost = cost, s->theta = absolute_sum(s->c, s->nlp.rows);
    for (int i = 0; i < s->nlp.rows; i++) s->lam[i] += alpha * s->dlam[i];
    memcpy(s->w, s->trial, s->nlp.all * sizeof *s->w);
    for (int i = 0; i < s->nlp.all; i++) {
        double below = s->w[i] - s->lower[i], above = s->upper[i] - s->w[i];
        if (s->zl[i] > 0)
            s->zl[i] = larger(smaller(s->zl[i] + alpha_dual * s->dzl[i], 1e10 * s->mu / below), 1e-10 * s->mu / below);
        if (s->zu[i] > 0)
            s->zu[i] = larger(smaller(s->zu[i] + alpha_dual * s->dzu[i], 1e10 * s->mu / above), 1e-10 * s->mu / above);
    }
}

/* Projection of w into its bounds by a relative distance `part`, section 3.6. */
static double push_inside(double w, double low, double high, double part) {
    if (isfinite(low)) w = larger(w, low + part * smaller(larger(1, fabs(low)), high - low));
    if (isfinite(high)) w = smaller(w, high - part * smaller(larger(1, fabs(high)), high - low));
    return w;
}

/* Restoration phase: Newton steps for c(w) = 0 that minimise the distance from the initial point and the barrier, until
   the infeasibility is reduced and the filter accepts; a simplification of section 3.3. */
static int restore(Solve *s, int *k, int iterations) {
    double theta_0 = s->theta, weight = sqrt(s->mu), cost, theta = theta_0, phi = s->phi, alpha, *from = s->other_dw;
    augment_filter(s);
    for (int i = 0; i < s->nlp.all; i++) /* unknowns at bounds shorten all steps and make the equations stiff */
        if (s->nlp.is_free[i]) s->w[i] = push_inside(s->w[i], s->lower[i], s->upper[i], 1e-4);
    if (!evaluate(&s->nlp, s->w, &s->cost, s->c, NULL)) return 0;
    s->theta = absolute_sum(s->c, s->nlp.rows);
    differentiate(&s->nlp, s->w, s->lam, s->gradient, s->d);
    memcpy(from, s->w, s->nlp.all * sizeof *from);
    do {
        if (++*k > iterations) return 0;
        clear_hessians(&s->nlp);
        for (int i = 0; i < s->nlp.all; i++) {
            double scale = larger(1, fabs(from[i])), near = weight / (scale * scale);
            double below = s->w[i] - s->lower[i], above = s->upper[i] - s->w[i];
            s->nlp.sigma[i] = near + s->mu / (below * below) + s->mu / (above * above);
            s->d[i] = near * (s->w[i] - from[i]) - s->mu / below + s->mu / above;
            if (!s->nlp.is_free[i]) s->nlp.sigma[i] = 1e30, s->d[i] = 0;
        }
        if (!factor(&s->nlp, &s->end)) return 0;
        step(&s->nlp, &s->end, s->d, s->c, s->dw, s->dlam);
        for (alpha = longest_primal(s, s->dw, 0.99); alpha > 1e-8; alpha /= 2)
            if (try_step(s, s->dw, alpha, &cost, &theta, &phi) && theta <= (1 - 1e-4 * alpha) * s->theta) break;
        if (alpha <= 1e-8) return 0;
        advance(s, cost, 0, 0);
        differentiate(&s->nlp, s->w, s->lam, s->gradient, s->d);
    } while (theta > 0.9 * theta_0 || !filter_accepts(s, theta, phi));
    for (int i = 0; i < s->nlp.all; i++) {
        if (s->zl[i] > 0) s->zl[i] = s->mu / (s->w[i] - s->lower[i]);
        if (s->zu[i] > 0) s->zu[i] = s->mu / (s->upper[i] - s->w[i]);
    }
    multipliers(s);
    return 1;
}

/* Newton's step (11), (12); returns its size relative to w. */
static double newton(Solve *s) {
    double largest = 0;
    s->descent = 0;
    for (int i = 0; i < s->nlp.all; i++) {
        double push = 0;
        if (s->zl[i] > 0) push -= s->mu / (s->w[i] - s->lower[i]);
        if (s->zu[i] > 0) push += s->mu / (s->upper[i] - s->w[i]);
        s->d[i] = s->nlp.is_free[i] ? s->d[i] + push : 0, s->trial[i] = s->gradient[i] + push;
    }
    step(&s->nlp, &s->end, s->d, s->c, s->dw, s->dlam);
    for (int i = 0; i < s->nlp.all; i++) {
        s->descent += s->trial[i] * s->dw[i];
        largest = larger(largest, fabs(s->dw[i]) / (1 + fabs(s->w[i])));
        if (s->zl[i] > 0) s->dzl[i] = (s->mu - s->zl[i] * s->dw[i]) / (s->w[i] - s->lower[i]) - s->zl[i];
        if (s->zu[i] > 0) s->dzu[i] = (s->mu + s->zu[i] * s->dw[i]) / (s->upper[i] - s->w[i]) - s->zu[i];
    }
    return largest;
}

/* Store the best iterate so far: the one of least mu, then of least E_0. */
static void store_best(Solve *s, double error) {
    s->best_error = error, s->best_mu = s->mu;
    memcpy(s->best_w, s->w, s->nlp.all * sizeof *s->w), memcpy(s->best_lam, s->lam, s->nlp.rows * sizeof *s->lam);
    memcpy(s->best_zl, s->zl, s->nlp.all * sizeof *s->zl), memcpy(s->best_zu, s->zu, s->nlp.all * sizeof *s->zu);
}

/* Final status: the best iterate counts as acceptable if E_0 <= `close` was reached. */
static int return_best(Solve *s, int ended) {
    if (ended == SOLVED || ended == STOPPED || !isfinite(s->best_error)) return ended;
    memcpy(s->w, s->best_w, s->nlp.all * sizeof *s->w), memcpy(s->lam, s->best_lam, s->nlp.rows * sizeof *s->lam);
    memcpy(s->zl, s->best_zl, s->nlp.all * sizeof *s->zl), memcpy(s->zu, s->best_zu, s->nlp.all * sizeof *s->zu);
    return ACCEPTED;
}

/* Whether the barrier function of the present mu has stopped falling at iteration k. */
static int stalled(Solve *s, const Settings *settings, int k) {
    int same = s->mu == s->checked_mu;
    if (same && k < s->checked_at + settings->after) return 0;
    double phi = barrier_function(s, s->w, s->cost);
    int hardly = same && s->checked_phi - phi < settings->still;
    s->checked_mu = s->mu, s->checked_at = k, s->checked_phi = phi;
    return hardly;
}

/* Main loop, algorithm A; returns the status, and the number of iterations in `k`. */
static int iterate(Solve *s, const Settings *settings, int every, Monitor monitor, int *k) {
    double least_mu = settings->tolerance / 11, cost, alpha, tau, error;
    int acceptable = 0, tiny = 0, still;
    for (*k = 0;; ++*k) {
        differentiate(&s->nlp, s->w, s->lam, s->gradient, s->d);
        for (int i = 0; i < s->nlp.all; i++) s->d[i] += s->gradient[i];
        error = error_of(s, 0);
        if (!isfinite(error)) return INVALID_NUMBER;
        acceptable = error <= ACCEPTABLE ? acceptable + 1 : 0;
        if (error <= settings->close && (s->mu < s->best_mu || error < s->best_error)) store_best(s, error);
        if (error <= settings->tolerance) return SOLVED;
        if (acceptable == ACCEPTED_AFTER) return ACCEPTED;
        if (*k >= settings->iterations) return ITERATIONS;
        if (*k % every == 0 && monitor(*k, s->cost, s->theta, error, s->mu)) return STOPPED;
        still = settings->after && stalled(s, settings, *k) && s->best_mu <= s->mu;
        if (still && s->mu <= least_mu) return ACCEPTED;
        while (s->mu > least_mu && (tiny || still || error_of(s, s->mu) <= 10 * s->mu)) {
            s->mu = larger(least_mu, smaller(0.2 * s->mu, pow(s->mu, 1.5))); /* (7) */
            s->filtered = tiny = still = 0;
        }
        if (tiny) return acceptable ? ACCEPTED : TINY_STEP;
        tau = larger(0.99, 1 - s->mu);
        s->phi = barrier_function(s, s->w, s->cost);
        if (factor_corrected(s)) {
            tiny = newton(s) < 10 * 2.2e-16 && s->theta < 1e-4; /* below rounding: section 3.9 */
            if (tiny ? full_step(s, tau, &alpha, &cost) : line_search(s, tau, &alpha, &cost)) {
                advance(s, cost, alpha, longest_dual(s, tau));
                continue;
            }
        }
        tiny = 0;
        if (!restore(s, k, settings->iterations))
            return *k > settings->iterations ? (*k = settings->iterations, ITERATIONS) : RESTORATION_FAILED;
    }
}

/* Initial unknown within its relaxed bounds, section 3.6. Without a bound, or fixed: no multiplier. */
static void start_unknown(Solve *s, int i, double lower, double upper, double push, double *low, double *high) {
    *low = lower - RELAXED * larger(1, fabs(lower)), *high = upper + RELAXED * larger(1, fabs(upper));
    if (!s->nlp.is_free[i]) {
        s->w[i] = i < s->nlp.size ? lower : 0;
        return;
    }
    s->w[i] = push_inside(s->w[i], *low, *high, push ? push : 1e-2);
    if (isfinite(lower)) s->zl[i] = push ? s->mu / (s->w[i] - *low) : 1;
    if (isfinite(upper)) s->zu[i] = push ? s->mu / (*high - s->w[i]) : 1;
}

/* Flags of the free unknowns: not the first and last state, not those with equal bounds, not slacks without bounds. */
static void mark_free(const Program *nlp, const double *lower, const double *upper, char *is_free) {
    for (int i = 0; i < nlp->all; i++) {
        int end = i < NX || (i >= BLOCK * nlp->N && i < nlp->size - 1);
        int needed = i < nlp->size || isfinite(lower[i]) || isfinite(upper[i]);
        is_free[i] = lower[i] < upper[i] && !end && needed;
    }
}

/* Initial unknowns, slacks, multipliers and function values; 0: not finite. */
static int initialise(Solve *s, const double *lower, const double *upper, double push, double *low, double *high) {
    Program *nlp = &s->nlp;
    s->lower = low, s->upper = high;
    for (int i = 0; i < nlp->size; i++) start_unknown(s, i, lower[i], upper[i], push, low + i, high + i);
    if (nlp->all > nlp->size) {
        if (!evaluate(nlp, s->w, &s->cost, s->c, s->w + nlp->size)) return 0;
        for (int i = nlp->size; i < nlp->all; i++) start_unknown(s, i, lower[i], upper[i], push, low + i, high + i);
    }
    if (!evaluate(nlp, s->w, &s->cost, s->c, NULL)) return 0;
    s->theta = absolute_sum(s->c, nlp->rows);
    s->least_theta = 1e-4 * larger(1, s->theta), s->most_theta = 1e4 * larger(1, s->theta);
    differentiate(nlp, s->w, s->lam, s->gradient, s->d);
    multipliers(s);
    return 1;
}

static Program program_of(int N, const double *parameters, int bounded) {
    int size = BLOCK * N + NX + 1, equations = NX * N;
    return (Program){.N = N, .size = size, .equations = equations, .parameters = parameters,
                     .all = size + (bounded ? equations : 0), .rows = (bounded ? 2 : 1) * equations};
}

/* Cost, equations and states in the intervals' middles, shape (NX, N) by columns; 0: not finite. */
int values_at(int N, const double *parameters, const double *w, double *c, double *middles) {
    Program nlp = program_of(N, parameters, 0);
    double cost;
    return evaluate(&nlp, w, &cost, c, middles);
}

/* Solve from w and overwrite it; lam: multipliers of the equations, z: of the bounds, k: iterations. x_0 and x_N are
   fixed to their lower bounds. With `bounded` middles w, lam, z and the bounds include the slacks, whose initial values
   are ignored. `monitor` is called every `every` iterations. */
int solve(int N, int bounded, const double *parameters, const double *lower, const double *upper,
          const Settings *settings, int every, Monitor monitor, double *w, double *lam, double *z, int *k) {
    Solve s = {.nlp = program_of(N, parameters, bounded), .w = w, .lam = lam, .mu = settings->barrier,
               .best_error = INFINITY, .best_mu = INFINITY};
    int n = s.nlp.all, m = s.nlp.rows, ended = NO_MEMORY;
    double *memory = calloc(17 * (size_t)n + 6 * (size_t)m, sizeof *memory), *next = memory;
    char *is_free = calloc(n, 1);
    s.nlp.stages = calloc(N, sizeof *s.nlp.stages), s.nlp.is_free = is_free;
    s.nlp.convex = settings->convex;
    if (s.nlp.stages && memory && is_free) {
        double **wide[] = {&s.zl, &s.zu, &s.gradient, &s.d, &s.dw, &s.dzl, &s.dzu, &s.trial, &s.other_dw,
                           &s.nlp.sigma, &s.nlp.reduced, &s.best_w, &s.best_zl, &s.best_zu};
        double **deep[] = {&s.c, &s.dlam, &s.trial_c, &s.other_c, &s.other_dlam, &s.best_lam};
        for (size_t i = 0; i < sizeof wide / sizeof *wide; i++, next += n) *wide[i] = next;
        for (size_t i = 0; i < sizeof deep / sizeof *deep; i++, next += m) *deep[i] = next;
        mark_free(&s.nlp, lower, upper, is_free);
        ended = INVALID_NUMBER, *k = 0, memset(lam, 0, m * sizeof *lam);
        if (initialise(&s, lower, upper, settings->push, next, next + n))
            ended = return_best(&s, iterate(&s, settings, every, monitor, k));
        for (int i = 0; i < n; i++) z[i] = s.zu[i] - s.zl[i];
    }
    free(memory), free(s.nlp.stages), free(is_free);
    return ended;
}
