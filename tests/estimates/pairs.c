/* Euler's equations by Taylor series in pairs of binary64, some 31 digits: a truth that is fast.

   It shares no code with the kernels: exact coefficients from Python, terms that are not scaled,
   steps in whole units of the time asked for, waves turned by the series of their own sine and
   cosine. Beside omega go its derivatives by the start of each step, so that the derivative of the
   end by omega at the end of any step is known at the end. */

#include <math.h>
#include <stdlib.h>

enum { AXES = 4, ORDER = 36, FLOW_ORDER = 30, LAST = 3, INSIDE = 4 };
enum { COMPLETE, TOO_MANY_STEPS, NO_BOUND, NO_MEMORY };

static const double SMALL = 1e-32; /* last terms of a step beside the first ones */
static const double CAUTION = 0.9;
static const double MOST_ANGLE = 1.5; /* by which a wave turns in a step */

typedef double lanes_t __attribute__((vector_size(32)));
typedef struct {
    double hi, lo;
} pair_t;
typedef struct {
    lanes_t hi, lo;
} vector_t; /* four pairs; the last is idle */

typedef struct {
    vector_t amplitude; /* over the moments */
    pair_t sine, cosine;
    double frequency;
    pair_t weight[ORDER + 1]; /* frequency**k / k! */
} wave_t;

static inline lanes_t same(double x) { return (lanes_t){x, x, x, x}; }

static inline lanes_t fused(lanes_t a, lanes_t b, lanes_t c) {
    lanes_t d;
    for (int i = 0; i < AXES; i++)
        d[i] = __builtin_fma(a[i], b[i], c[i]);
    return d;
}

static inline vector_t sum(vector_t a, vector_t b) {
    const lanes_t s = a.hi + b.hi, t = s - a.hi;
    const lanes_t rest = (a.hi - (s - t)) + (b.hi - t) + (a.lo + b.lo);
    const lanes_t hi = s + rest;
    return (vector_t){hi, rest - (hi - s)};
}

static inline vector_t product(vector_t a, vector_t b) {
    const lanes_t p = a.hi * b.hi;
    const lanes_t rest = fused(a.hi, b.lo, fused(a.lo, b.hi, fused(a.hi, b.hi, -p)));
    const lanes_t hi = p + rest;
    return (vector_t){hi, rest - (hi - p)};
}

/* Add a product to a total whose small part may overlap the large one. */
static inline void gather(vector_t *total, vector_t a, vector_t b) {
    const lanes_t p = a.hi * b.hi;
    const lanes_t rest = fused(a.hi, b.lo, fused(a.lo, b.hi, fused(a.hi, b.hi, -p)));
    const lanes_t s = total->hi + p, t = s - total->hi;
    total->lo += (total->hi - (s - t)) + (p - t) + rest;
    total->hi = s;
}

static inline vector_t tidy(vector_t a) {
    const lanes_t hi = a.hi + a.lo;
    return (vector_t){hi, a.lo - (hi - a.hi)};
}

static inline vector_t all(pair_t a) { return (vector_t){same(a.hi), same(a.lo)}; }

static inline pair_t first(vector_t a) { return (pair_t){a.hi[0], a.lo[0]}; }

static pair_t pair_sum(pair_t a, pair_t b) { return first(sum(all(a), all(b))); }

static pair_t pair_product(pair_t a, pair_t b) { return first(product(all(a), all(b))); }

static pair_t reciprocal(int n) {
    const double hi = 1.0 / n;
    return (pair_t){hi, __builtin_fma(-hi, n, 1.0) / n};
}

/* (x, y, z) -> (y, z, x) and (z, x, y) */
static inline lanes_t turn(lanes_t a) { return (lanes_t){a[1], a[2], a[0], 0.0}; }
static inline vector_t next(vector_t a) { return (vector_t){turn(a.hi), turn(a.lo)}; }

static vector_t read(const double *from) {
    return (vector_t){{from[0], from[1], from[2], 0.0}, {from[3], from[4], from[5], 0.0}};
}

static double size(vector_t a) {
    return fmax(fabs(a.hi[0]), fmax(fabs(a.hi[1]), fabs(a.hi[2])));
}

/* Series of omega at a time, with both rotations of every term. */
static void expand(vector_t (*w)[3], vector_t products, vector_t constant, vector_t rate,
                   double time, const wave_t *waves, int n_waves, const pair_t *inverse) {
    for (int k = 0; k < ORDER; k++) {
        vector_t total = {{0.0}, {0.0}};
        for (int j = 0; j <= k; j++)
            gather(&total, w[j][1], w[k - j][2]);
        total = product(tidy(total), products);
        if (k == 0) {
            total = sum(total, constant);
            total = sum(total, product(rate, all((pair_t){time, 0.0})));
        } else if (k == 1) {
            total = sum(total, rate);
        }
        for (int n = 0; n < n_waves; n++) {
            pair_t part = pair_product(waves[n].weight[k],
                                       k % 2 ? waves[n].cosine : waves[n].sine);
            if (k % 4 > 1)
                part = (pair_t){-part.hi, -part.lo};
            gather(&total, waves[n].amplitude, all(part));
        }
        w[k + 1][0] = product(tidy(total), all(inverse[k + 1]));
        w[k + 1][1] = next(w[k + 1][0]);
        w[k + 1][2] = next(w[k + 1][1]);
    }
}

/* Series of the derivative of omega by omega at the start of the step, a column each. */
static void expand_flow(vector_t (*m)[3][3], vector_t (*w)[3], vector_t products,
                        const pair_t *inverse) {
    for (int k = 0; k < FLOW_ORDER; k++) {
        vector_t total[3] = {{{0.0}, {0.0}}, {{0.0}, {0.0}}, {{0.0}, {0.0}}};
        for (int j = 0; j <= k; j++)
            for (int c = 0; c < 3; c++) {
                gather(&total[c], w[j][1], m[k - j][c][2]);
                gather(&total[c], w[j][2], m[k - j][c][1]);
            }
        for (int c = 0; c < 3; c++) {
            const vector_t term = product(product(tidy(total[c]), products), all(inverse[k + 1]));
            m[k + 1][c][0] = term;
            m[k + 1][c][1] = next(term);
            m[k + 1][c][2] = next(m[k + 1][c][1]);
        }
    }
}

static int is_finite(vector_t a) {
    return isfinite(a.hi[0]) && isfinite(a.hi[1]) && isfinite(a.hi[2]);
}

/* Longest step for which the last terms are small beside the first ones; 0 where they are no
   numbers. */
static double step_of(vector_t (*w)[3]) {
    double length = INFINITY;
    for (int k = ORDER - LAST + 1; k <= ORDER; k++) {
        double longest = 0.0;
        if (!is_finite(w[k][0]))
            return 0.0;
        for (int j = 0; j < 4; j++)
            if (size(w[k][0]) > 0.0 && size(w[j][0]) > 0.0)
                longest = fmax(longest, exp(log(SMALL * size(w[j][0]) / size(w[k][0])) / (k - j)));
        if (size(w[k][0]) > 0.0)
            length = fmin(length, CAUTION * longest);
    }
    return length;
}

static void turn_wave(wave_t *wave, double step) {
    pair_t sine = {0.0, 0.0}, cosine = {0.0, 0.0};
    for (int k = ORDER; k >= 0; k--) {
        pair_t *into = k % 2 ? &sine : &cosine, *other = k % 2 ? &cosine : &sine;
        pair_t term = wave->weight[k];
        if (k % 4 > 1)
            term = (pair_t){-term.hi, -term.lo};
        *into = pair_sum(*into, term);
        if (k > 0) {
            *into = pair_product(*into, (pair_t){step, 0.0});
            *other = pair_product(*other, (pair_t){step, 0.0});
        }
    }
    const pair_t s = wave->sine, c = wave->cosine, minus = {-s.hi, -s.lo};
    wave->sine = pair_sum(pair_product(s, cosine), pair_product(c, sine));
    wave->cosine = pair_sum(pair_product(c, cosine), pair_product(minus, sine));
}

/* 2-norm of three columns: root of the largest eigenvalue of their products with each other. */
static double norm(const vector_t *columns) {
    double g[3][3], most = 0.0;
    for (int c = 0; c < 3; c++)
        most = fmax(most, size(columns[c]));
    if (!(most < 1e300))
        return INFINITY;
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) {
            g[i][j] = 0.0;
            for (int axis = 0; axis < 3; axis++)
                g[i][j] += (columns[i].hi[axis] / most) * (columns[j].hi[axis] / most);
        }
    const double mean = (g[0][0] + g[1][1] + g[2][2]) / 3.0;
    const double beside = g[0][1] * g[0][1] + g[0][2] * g[0][2] + g[1][2] * g[1][2];
    double spread = 2.0 * beside;
    for (int i = 0; i < 3; i++)
        spread += (g[i][i] - mean) * (g[i][i] - mean);
    spread = sqrt(spread / 6.0);
    if (spread < 1e-14 * mean)
        return most * sqrt(mean);
    for (int i = 0; i < 3; i++) {
        g[i][i] -= mean;
        for (int j = 0; j < 3; j++)
            g[i][j] /= spread;
    }
    double half = g[0][0] * (g[1][1] * g[2][2] - g[1][2] * g[2][1]);
    half -= g[0][1] * (g[1][0] * g[2][2] - g[1][2] * g[2][0]);
    half += g[0][2] * (g[1][0] * g[2][1] - g[1][1] * g[2][0]);
    half = fmax(-1.0, fmin(1.0, 0.5 * half));
    return most * sqrt(mean + 2.0 * spread * cos(acos(half) / 3.0));
}

/* Go on from the derivative of the end by the end of a step to that by its start. */
static void compose(vector_t *flow, const vector_t *step) {
    vector_t found[3];
    for (int c = 0; c < 3; c++) {
        found[c] = (vector_t){{0.0}, {0.0}};
        for (int axis = 0; axis < 3; axis++)
            gather(&found[c], flow[axis], all((pair_t){step[c].hi[axis], step[c].lo[axis]}));
        found[c] = tidy(found[c]);
    }
    for (int c = 0; c < 3; c++)
        flow[c] = found[c];
}

/* Vectors are three large parts and three small ones; a wave is amplitude so, frequency, and
   whether it is a cosine. `found` is omega so, the largest on the way, the angle turned, growth. */
int pairs_truth(const double *products, const double *constant, const double *rate, int n_waves,
                const double *given, const double *start, double end, int most_steps, double *found,
                int *steps) {
    vector_t w[ORDER + 1][3], m[FLOW_ORDER + 1][3][3];
    const vector_t abc = read(products), push = read(constant), ramp = read(rate);
    pair_t inverse[ORDER + 1];
    int status = COMPLETE, most = 0;
    double time = 0.0, largest = 0.0, angle = 0.0, cap = INFINITY;
    const double sign = end < 0.0 ? -1.0 : 1.0, unit = ldexp(1.0, ilogb(end) - 52);
    vector_t(*flows)[3] = NULL;
    wave_t *waves = aligned_alloc(32, sizeof(wave_t) * (n_waves + 1));

    *steps = 0;
    if (!waves)
        return NO_MEMORY;
    for (int k = 1; k <= ORDER; k++)
        inverse[k] = reciprocal(k);
    for (int n = 0; n < n_waves; n++) {
        wave_t *wave = &waves[n];
        const double *from = given + 8 * n;
        wave->amplitude = read(from);
        wave->frequency = from[6];
        wave->sine = (pair_t){from[7] != 0.0 ? 1.0 : 0.0, 0.0};
        wave->cosine = (pair_t){from[7] != 0.0 ? 0.0 : 1.0, 0.0};
        wave->weight[0] = (pair_t){1.0, 0.0};
        for (int k = 1; k <= ORDER; k++) {
            const pair_t factor = pair_product(inverse[k], (pair_t){wave->frequency, 0.0});
            wave->weight[k] = pair_product(wave->weight[k - 1], factor);
        }
        if (wave->frequency != 0.0)
            cap = fmin(cap, MOST_ANGLE / fabs(wave->frequency));
    }
    w[0][0] = (vector_t){{start[0], start[1], start[2], 0.0}, {0.0}};
    largest = size(w[0][0]);
    while (time != end) {
        if (*steps == most_steps) {
            status = TOO_MANY_STEPS;
            break;
        }
        if (*steps == most) {
            most = most ? 2 * most : 256;
            vector_t(*more)[3] = aligned_alloc(32, sizeof(*flows) * most);
            if (!more) {
                status = NO_MEMORY;
                break;
            }
            for (int n = 0; n < *steps; n++)
                for (int c = 0; c < 3; c++)
                    more[n][c] = flows[n][c];
            free(flows);
            flows = more;
        }
        w[0][1] = next(w[0][0]);
        w[0][2] = next(w[0][1]);
        expand(w, abc, push, ramp, time, waves, n_waves, inverse);
        /* Whole units, so that neither the time nor the rest of it is ever rounded. */
        const double rest = fabs(end - time);
        double length = fmin(step_of(w), cap);
        length = length < rest ? floor(length / unit) * unit : rest;
        if (!(length > 0.0)) {
            status = NO_BOUND;
            break;
        }
        const double step = sign * length;
        for (int c = 0; c < 3; c++) {
            m[0][c][0] = (vector_t){{0.0}, {0.0}};
            m[0][c][0].hi[c] = 1.0;
            m[0][c][1] = next(m[0][c][0]);
            m[0][c][2] = next(m[0][c][1]);
        }
        expand_flow(m, w, abc, inverse);
        for (int i = 1; i <= INSIDE; i++) {
            lanes_t there = w[ORDER][0].hi;
            for (int k = ORDER - 1; k >= 0; k--)
                there = there * same(step * i / INSIDE) + w[k][0].hi;
            largest = fmax(largest, size((vector_t){there, {0.0}}));
            there *= there;
            angle += length / INSIDE * sqrt(there[0] + there[1] + there[2]);
        }
        const vector_t by = all((pair_t){step, 0.0});
        vector_t omega = w[ORDER][0];
        for (int k = ORDER - 1; k >= 0; k--)
            omega = sum(product(omega, by), w[k][0]);
        for (int c = 0; c < 3; c++) {
            vector_t column = m[FLOW_ORDER][c][0];
            for (int k = FLOW_ORDER - 1; k >= 0; k--)
                column = sum(product(column, by), m[k][c][0]);
            flows[*steps][c] = column;
        }
        for (int n = 0; n < n_waves; n++)
            turn_wave(&waves[n], step);
        w[0][0] = omega;
        largest = is_finite(omega) ? fmax(largest, size(omega)) : INFINITY;
        time = length == rest ? end : time + step;
        ++*steps;
        if (!(largest < 1e100)) {
            status = NO_BOUND;
            break;
        }
    }
    double growth = 1.0;
    vector_t flow[3] = {{{1.0}, {0.0}}, {{0.0, 1.0}, {0.0}}, {{0.0, 0.0, 1.0}, {0.0}}};
    for (int n = *steps - 1; n >= 0 && growth < INFINITY; n--) {
        compose(flow, flows[n]);
        growth = fmax(growth, norm(flow));
    }
    for (int axis = 0; axis < 3; axis++) {
        found[axis] = w[0][0].hi[axis];
        found[axis + 3] = w[0][0].lo[axis];
    }
    found[6] = largest;
    found[7] = angle;
    found[8] = growth;
    free(flows);
    free(waves);
    return status;
}
