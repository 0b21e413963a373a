/* Minimum of the cost with c(w) = 0 and lower <= w <= upper, by the method of `line_search.c`'s authors: steps by
   Riccati's sweep instead of a sparse factorization, and a simpler way back to the equations, are what is ours. */

enum { SOLVED, ACCEPTED, ITERATIONS, STOPPED, NO_WAY_BACK, NO_NUMBERS, NO_STEP, NO_MEMORY };

/* Bounds are loosened so much; E_mu of (5) is acceptable below that if it stays there. */
static const double RELAXED = 1e-8, ACCEPTABLE = 1e-6;
enum { ACCEPTED_AFTER = 15 };

/* How a program is solved: E_0 <= `tolerance`, after so many iterations at most; `barrier`: the first mu. A start near
   the solution is moved off its bounds by `push` as in section 3.6, with multipliers of that mu; 0: as IPOPT has it.
   Ours is what joints need that time leaves idle, or nearly: along their torques the cost is flat, or curved either way.
   Where it has no minimum along an interval's torques, those alone get a curvature of at least `convex` (0: all
   unknowns get more, as by section 3.1). Where the barrier function falls by no more than `still` in `after`
   iterations the next mu is taken. Where iterations end so, or without a solution, the best iterate of E_0 <= `close`
   will do. */
typedef struct {
    double tolerance, barrier, push, close, still, convex;
    int iterations, after;
} Settings;

/* Told where it stands; not zero: stop. */
typedef int (*Watch)(int iteration, double cost, double infeasible, double error, double mu);

/* E_mu (5), where d is the gradient of cost + lam'c; what is no number is no error, and shows in the sum. */
static double error_of(const Solve *s, double mu) {
    double dual = 0, gaps = 0, equations = 0, z = 0, sum = 0, all;
    int n = 0;
    for (int i = 0; i < s->it.all; i++) {
        if (!s->it.open[i]) continue;
        dual = larger(dual, fabs(s->d[i] - s->zl[i] + s->zu[i])), sum += s->d[i];
        if (isfinite(s->lower[i]))
            gaps = larger(gaps, fabs((s->w[i] - s->lower[i]) * s->zl[i] - mu)), z += s->zl[i], n++;
        if (isfinite(s->upper[i]))
            gaps = larger(gaps, fabs((s->upper[i] - s->w[i]) * s->zu[i] - mu)), z += s->zu[i], n++;
    }
    for (int i = 0; i < s->it.rows; i++) equations = larger(equations, fabs(s->c[i]));
    all = absolute_sum(s->lam, s->it.rows) + z;
    dual /= larger(100, all / (s->it.rows + n)) / 100, gaps /= larger(100, z / n) / 100;
    return isfinite(all) && isfinite(sum) ? larger(larger(dual, equations), gaps) : NAN;
}

/* Factors with as much on the diagonal as a minimum takes, section 3.1; 0: nothing helps. What is held has 1e30. */
static int factored(Solve *s) {
    double delta = 0;
    for (int i = 0; i < s->it.all; i++) {
        s->it.bent[i] = s->it.open[i] ? 0 : 1e30;
        if (s->zl[i] > 0) s->it.bent[i] += s->zl[i] / (s->w[i] - s->lower[i]);
        if (s->zu[i] > 0) s->it.bent[i] += s->zu[i] / (s->upper[i] - s->w[i]);
    }
    while (!factor(&s->it, &s->end)) {
        double more = delta ? delta * (s->last ? 8 : 100) : s->last ? larger(1e-20, s->last / 3) : 1e-4;
        if (more > 1e20) return 0;
        for (int i = 0; i < s->it.all; i++) s->it.bent[i] += more - delta;
        delta = more;
    }
    if (delta) s->last = delta;
    return 1;
}

/* Multipliers of the equations by least squares, section 3.6; zero where they are large. */
static void multipliers(Solve *s) {
    double largest = 0;
    flatten(&s->it);
    for (int i = 0; i < s->it.all; i++) {
        s->it.bent[i] = s->it.open[i] ? 1 : 1e30;
        s->d[i] = s->it.open[i] ? s->gradient[i] - s->zl[i] + s->zu[i] : 0;
    }
    memset(s->other_c, 0, s->it.rows * sizeof *s->c), memset(s->lam, 0, s->it.rows * sizeof *s->lam);
    if (!factor(&s->it, &s->end)) return;
    step(&s->it, &s->end, s->d, s->other_c, s->dw, s->dlam);
    for (int i = 0; i < s->it.rows; i++) largest = larger(largest, fabs(s->dlam[i]));
    if (largest <= 1e3) memcpy(s->lam, s->dlam, s->it.rows * sizeof *s->lam);
}

/* On to the trial: unknowns and their multipliers; these stay near the central path (16). */
static void advance(Solve *s, double cost, double alpha, double alpha_dual) {
    double *swap = s->c;
    s->c = s->trial_c, s->trial_c = swap, s->cost = cost, s->theta = absolute_sum(s->c, s->it.rows);
    for (int i = 0; i < s->it.rows; i++) s->lam[i] += alpha * s->dlam[i];
    memcpy(s->w, s->trial, s->it.all * sizeof *s->w);
    for (int i = 0; i < s->it.all; i++) {
        double below = s->w[i] - s->lower[i], above = s->upper[i] - s->w[i];
        if (s->zl[i] > 0)
            s->zl[i] = larger(smaller(s->zl[i] + alpha_dual * s->dzl[i], 1e10 * s->mu / below), 1e-10 * s->mu / below);
        if (s->zu[i] > 0)
            s->zu[i] = larger(smaller(s->zu[i] + alpha_dual * s->dzu[i], 1e10 * s->mu / above), 1e-10 * s->mu / above);
    }
}

/* A number so far from its bounds, as a part of them or of the room between. */
static double inside(double w, double low, double high, double part) {
    if (isfinite(low)) w = larger(w, low + part * smaller(larger(1, fabs(low)), high - low));
    if (isfinite(high)) w = smaller(w, high - part * smaller(larger(1, fabs(high)), high - low));
    return w;
}

/* Back to where the equations nearly hold and the filter lets through: Newton's steps for the equations alone, of all
   those the shortest by the distance from where it began and by the barrier; nearly what section 3.3 minimizes. */
static int restored(Solve *s, int *k, int iterations) {
    double begun = s->theta, weight = sqrt(s->mu), cost, theta = begun, phi = s->phi, alpha, *from = s->other_dw;
    into_filter(s);
    for (int i = 0; i < s->it.all; i++) /* what sticks to its bound makes all steps short, and the equations stiff */
        if (s->it.open[i]) s->w[i] = inside(s->w[i], s->lower[i], s->upper[i], 1e-4);
    if (!evaluate(&s->it, s->w, &s->cost, s->c, NULL)) return 0;
    s->theta = absolute_sum(s->c, s->it.rows);
    differentiate(&s->it, s->w, s->lam, s->gradient);
    memcpy(from, s->w, s->it.all * sizeof *from);
    do {
        if (++*k > iterations) return 0;
        flatten(&s->it);
        for (int i = 0; i < s->it.all; i++) {
            double scale = larger(1, fabs(from[i])), near = weight / (scale * scale);
            double below = s->w[i] - s->lower[i], above = s->upper[i] - s->w[i];
            s->it.bent[i] = near + s->mu / (below * below) + s->mu / (above * above);
            s->d[i] = near * (s->w[i] - from[i]) - s->mu / below + s->mu / above;
            if (!s->it.open[i]) s->it.bent[i] = 1e30, s->d[i] = 0;
        }
        if (!factor(&s->it, &s->end)) return 0;
        step(&s->it, &s->end, s->d, s->c, s->dw, s->dlam);
        for (alpha = longest(s, s->dw, 0.99); alpha > 1e-8; alpha /= 2)
            if (tried(s, s->dw, alpha, &cost, &theta, &phi) && theta <= (1 - 1e-4 * alpha) * s->theta) break;
        if (alpha <= 1e-8) return 0;
        advance(s, cost, 0, 0);
        differentiate(&s->it, s->w, s->lam, s->gradient);
    } while (theta > 0.9 * begun || !filter_lets_through(s, theta, phi));
    for (int i = 0; i < s->it.all; i++) {
        if (s->zl[i] > 0) s->zl[i] = s->mu / (s->w[i] - s->lower[i]);
        if (s->zu[i] > 0) s->zu[i] = s->mu / (s->upper[i] - s->w[i]);
    }
    multipliers(s);
    return 1;
}

/* Newton's step of all (11) to (12); how large it is beside w. */
static double newton(Solve *s) {
    double largest = 0;
    s->descent = 0;
    for (int i = 0; i < s->it.all; i++) {
        double push = 0;
        if (s->zl[i] > 0) push -= s->mu / (s->w[i] - s->lower[i]);
        if (s->zu[i] > 0) push += s->mu / (s->upper[i] - s->w[i]);
        s->d[i] = s->it.open[i] ? s->d[i] + push : 0, s->trial[i] = s->gradient[i] + push;
    }
    step(&s->it, &s->end, s->d, s->c, s->dw, s->dlam);
    for (int i = 0; i < s->it.all; i++) {
        s->descent += s->trial[i] * s->dw[i];
        largest = larger(largest, fabs(s->dw[i]) / (1 + fabs(s->w[i])));
        if (s->zl[i] > 0) s->dzl[i] = (s->mu - s->zl[i] * s->dw[i]) / (s->w[i] - s->lower[i]) - s->zl[i];
        if (s->zu[i] > 0) s->dzu[i] = (s->mu + s->zu[i] * s->dw[i]) / (s->upper[i] - s->w[i]) - s->zu[i];
    }
    return largest;
}

/* The best iterate so far: that of the least mu, and of the least E_0 there. */
static void keep(Solve *s, double error) {
    s->closest = error, s->closest_mu = s->mu;
    memcpy(s->best_w, s->w, s->it.all * sizeof *s->w), memcpy(s->best_lam, s->lam, s->it.rows * sizeof *s->lam);
    memcpy(s->best_zl, s->zl, s->it.all * sizeof *s->zl), memcpy(s->best_zu, s->zu, s->it.all * sizeof *s->zu);
}

/* How iterations end: where there is an iterate close to a solution it will do. */
static int closest(Solve *s, int ended) {
    if (ended == SOLVED || ended == STOPPED || !isfinite(s->closest)) return ended;
    memcpy(s->w, s->best_w, s->it.all * sizeof *s->w), memcpy(s->lam, s->best_lam, s->it.rows * sizeof *s->lam);
    memcpy(s->zl, s->best_zl, s->it.all * sizeof *s->zl), memcpy(s->zu, s->best_zu, s->it.all * sizeof *s->zu);
    return ACCEPTED;
}

/* Whether the barrier function hardly falls any more, of this mu, at iteration k. */
static int stalled(Solve *s, const Settings *how, int k) {
    int same = s->mu == s->watched_mu;
    if (same && k < s->watched + how->after) return 0;
    double phi = barrier_function(s, s->w, s->cost);
    int hardly = same && s->watched_phi - phi < how->still;
    s->watched_mu = s->mu, s->watched = k, s->watched_phi = phi;
    return hardly;
}

/* Iterations; returns how they ended, and in `k` after how many. */
static int iterate(Solve *s, const Settings *how, int asked, Watch watch, int *k) {
    double least_mu = how->tolerance / 11, cost, alpha, tau, error;
    int acceptable = 0, tiny = 0, still;
    for (*k = 0;; ++*k) {
        differentiate(&s->it, s->w, s->lam, s->gradient);
        transposed(&s->it, s->lam, s->d);
        for (int i = 0; i < s->it.all; i++) s->d[i] += s->gradient[i];
        error = error_of(s, 0);
        if (!isfinite(error)) return NO_NUMBERS;
        acceptable = error <= ACCEPTABLE ? acceptable + 1 : 0;
        if (error <= how->close && (s->mu < s->closest_mu || error < s->closest)) keep(s, error);
        if (error <= how->tolerance) return SOLVED;
        if (acceptable == ACCEPTED_AFTER) return ACCEPTED;
        if (*k >= how->iterations) return ITERATIONS;
        if (*k % asked == 0 && watch(*k, s->cost, s->theta, error, s->mu)) return STOPPED;
        still = how->after && stalled(s, how, *k) && s->closest_mu <= s->mu;
        if (still && s->mu <= least_mu) return ACCEPTED;
        while (s->mu > least_mu && (tiny || still || error_of(s, s->mu) <= 10 * s->mu)) {
            s->mu = larger(least_mu, smaller(0.2 * s->mu, pow(s->mu, 1.5))); /* (7) */
            s->filtered = tiny = still = 0;
        }
        if (tiny) return acceptable ? ACCEPTED : NO_STEP;
        tau = larger(0.99, 1 - s->mu);
        s->phi = barrier_function(s, s->w, s->cost);
        if (factored(s)) {
            tiny = newton(s) < 10 * 2.2e-16 && s->theta < 1e-4; /* rounding decides: section 3.9 */
            if (tiny ? whole_step(s, tau, &alpha, &cost) : line_search(s, tau, &alpha, &cost)) {
                advance(s, cost, alpha, longest_dual(s, tau));
                continue;
            }
        }
        tiny = 0;
        if (!restored(s, k, how->iterations))
            return *k > how->iterations ? (*k = how->iterations, ITERATIONS) : NO_WAY_BACK;
    }
}

/* Between its bounds, loosened; what has none, or is held, has no multipliers. Section 3.6. */
static void begin(Solve *s, int i, double lower, double upper, double push, double *low, double *high) {
    *low = lower - RELAXED * larger(1, fabs(lower)), *high = upper + RELAXED * larger(1, fabs(upper));
    if (!s->it.open[i]) {
        s->w[i] = i < s->it.size ? lower : 0;
        return;
    }
    s->w[i] = inside(s->w[i], *low, *high, push ? push : 1e-2);
    if (isfinite(lower)) s->zl[i] = push ? s->mu / (s->w[i] - *low) : 1;
    if (isfinite(upper)) s->zu[i] = push ? s->mu / (*high - s->w[i]) : 1;
}

/* Which unknowns are free: not the first and the last state, nor what bounds leave no room or, of slacks, have none. */
static void opened(const Program *it, const double *lower, const double *upper, char *open) {
    for (int i = 0; i < it->all; i++) {
        int end = i < NX || (i >= BLOCK * it->N && i < it->size - 1);
        int needed = i < it->size || isfinite(lower[i]) || isfinite(upper[i]);
        open[i] = lower[i] < upper[i] && !end && needed;
    }
}

/* Unknowns, slacks and multipliers to begin with, and what is there; 0: no numbers. */
static int begun(Solve *s, const double *lower, const double *upper, double push, double *low, double *high) {
    Program *it = &s->it;
    s->lower = low, s->upper = high;
    for (int i = 0; i < it->size; i++) begin(s, i, lower[i], upper[i], push, low + i, high + i);
    if (it->all > it->size) {
        if (!evaluate(it, s->w, &s->cost, s->c, s->w + it->size)) return 0;
        for (int i = it->size; i < it->all; i++) begin(s, i, lower[i], upper[i], push, low + i, high + i);
    }
    if (!evaluate(it, s->w, &s->cost, s->c, NULL)) return 0;
    s->theta = absolute_sum(s->c, it->rows);
    s->least_theta = 1e-4 * larger(1, s->theta), s->most_theta = 1e4 * larger(1, s->theta);
    differentiate(it, s->w, s->lam, s->gradient);
    multipliers(s);
    return 1;
}

static Program program_of(int N, const double *parameters, int bounded) {
    int size = BLOCK * N + NX + 1, equations = NX * N;
    return (Program){.N = N, .size = size, .equations = equations, .parameters = parameters,
                     .all = size + (bounded ? equations : 0), .rows = (bounded ? 2 : 1) * equations};
}

/* Cost, equations and the states in the middles, shape (NX, N) by columns; 0: no numbers. */
int values_at(int N, const double *parameters, const double *w, double *c, double *middles) {
    Program it = program_of(N, parameters, 0);
    double cost;
    return evaluate(&it, w, &cost, c, middles);
}

/* Solves from w, where it ends; lam are the equations' multipliers, z the bounds', k the iterations. x_0 and x_N are
   held at their lower bounds. Where the middles are `bounded` w, lam, z and the bounds have places for them; of w these
   need not be set. `watch` is told every `asked` iterations. */
int solve(int N, int bounded, const double *parameters, const double *lower, const double *upper, const Settings *how,
          int asked, Watch watch, double *w, double *lam, double *z, int *k) {
    Solve s = {.it = program_of(N, parameters, bounded), .w = w, .lam = lam, .mu = how->barrier,
               .closest = INFINITY, .closest_mu = INFINITY};
    int n = s.it.all, m = s.it.rows, ended = NO_MEMORY;
    double *memory = calloc(17 * (size_t)n + 6 * (size_t)m, sizeof *memory), *next = memory;
    char *open = calloc(n, 1);
    s.it.stages = calloc(N, sizeof *s.it.stages), s.it.open = open;
    s.it.convex = how->convex;
    if (s.it.stages && memory && open) {
        double **wide[] = {&s.zl, &s.zu, &s.gradient, &s.d, &s.dw, &s.dzl, &s.dzu, &s.trial, &s.other_dw,
                           &s.it.bent, &s.it.reduced, &s.best_w, &s.best_zl, &s.best_zu};
        double **deep[] = {&s.c, &s.dlam, &s.trial_c, &s.other_c, &s.other_dlam, &s.best_lam};
        for (size_t i = 0; i < sizeof wide / sizeof *wide; i++, next += n) *wide[i] = next;
        for (size_t i = 0; i < sizeof deep / sizeof *deep; i++, next += m) *deep[i] = next;
        opened(&s.it, lower, upper, open);
        ended = NO_NUMBERS, *k = 0, memset(lam, 0, m * sizeof *lam);
        if (begun(&s, lower, upper, how->push, next, next + n))
            ended = closest(&s, iterate(&s, how, asked, watch, k));
        for (int i = 0; i < n; i++) z[i] = s.zu[i] - s.zl[i];
    }
    free(memory), free(s.it.stages), free(open);
    return ended;
}
