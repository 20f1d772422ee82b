/* Angular velocity and attitude of a rigid body by Taylor series in pairs of binary64, some 31
   digits: a fast truth.

   It shares no code with the kernels. The equations are those of angular momentum about the body's
   own axes, L' = L x omega + N with L = J omega and a full matrix J, so that no principal axis is
   ever computed; a body of coefficients A, B, C has equations 13-15 instead. Exact numbers come from
   Python, terms are not scaled, steps are whole units of the time requested, waves advance by the
   series of their own sine and cosine.

   The linearised equations of omega and of a small rotation are integrated beside them in binary64
   by the classical Runge-Kutta method in short steps: the error amplification is a factor that needs
   two digits. */

#include <math.h>
#include <stdlib.h>

enum { AXES = 4, ORDER = 36, LAST = 3, INSIDE = 4, LINEAR = 6, ITERATIONS = 60 };
enum { COMPLETE, TOO_MANY_STEPS, NO_BOUND, NO_MEMORY };
enum { OF_COEFFICIENTS, OF_INERTIA }; /* bodies */

static const double SMALL = 1e-32; /* last terms of a step beside the first ones */
static const double CAUTION = 0.9;
static const double MOST_ANGLE = 1.5; /* by which a wave turns in a step */
static const double LINEAR_STEP = 0.1; /* over the norm of the linearised equations */

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

static inline vector_t negative(vector_t a) { return (vector_t){-a.hi, -a.lo}; }

/* One part of a vector in all lanes. */
static inline vector_t part(vector_t a, int i) { return (vector_t){same(a.hi[i]), same(a.lo[i])}; }

/* Quaternions, scalar first, times i, j and k. */
static inline lanes_t by_i(lanes_t q) { return (lanes_t){-q[1], q[0], q[3], -q[2]}; }
static inline lanes_t by_j(lanes_t q) { return (lanes_t){-q[2], -q[3], q[0], q[1]}; }
static inline lanes_t by_k(lanes_t q) { return (lanes_t){-q[3], q[2], -q[1], q[0]}; }

static inline void by_units(vector_t q, vector_t *found) {
    found[0] = (vector_t){by_i(q.hi), by_i(q.lo)};
    found[1] = (vector_t){by_j(q.hi), by_j(q.lo)};
    found[2] = (vector_t){by_k(q.hi), by_k(q.lo)};
}

static inline vector_t conjugate(vector_t q) {
    const lanes_t sign = {1.0, -1.0, -1.0, -1.0};
    return (vector_t){q.hi * sign, q.lo * sign};
}

/* Add the cross product of two vectors, given with both rotations of their axes. */
static inline void gather_cross(vector_t *total, const vector_t *a, const vector_t *b) {
    gather(total, a[1], b[2]);
    gather(total, negative(a[2]), b[1]);
}

static double size(vector_t a) {
    return fmax(fabs(a.hi[0]), fmax(fabs(a.hi[1]), fabs(a.hi[2])));
}

/* A symmetric matrix in columns. */
static vector_t times(const vector_t *matrix, vector_t v) {
    vector_t total = {{0.0}, {0.0}};
    for (int i = 0; i < 3; i++)
        gather(&total, matrix[i], part(v, i));
    return tidy(total);
}

typedef struct {
    int body;
    vector_t products;             /* A, B, C */
    vector_t inertia[3], inverse[3]; /* columns */
    vector_t constant, rate;
    int n_waves;
    wave_t *waves;
    int with_attitude, in_space;
    pair_t reciprocals[ORDER + 1];
} problem_t;

/* Series around a time. Vectors have both rotations of their axes beside them. */
typedef struct {
    vector_t w[ORDER + 1][3], momentum[ORDER + 1][3];
    vector_t torque[ORDER + 1];                      /* about its own axes */
    vector_t pushed[ORDER + 1];                      /* about the body's */
    vector_t q[ORDER + 1], q_units[ORDER + 1][3];
    vector_t back_units[ORDER + 1][3];               /* of the conjugate */
    vector_t middle[ORDER + 1], middle_units[ORDER + 1][3]; /* conjugate times torque */
} series_t;

static void put(vector_t *of, vector_t value) {
    of[0] = value;
    of[1] = next(value);
    of[2] = next(of[1]);
}

static vector_t torque_term(const problem_t *of, int k, double time) {
    vector_t total = {{0.0}, {0.0}};
    if (k == 0) {
        total = sum(of->constant, product(of->rate, all((pair_t){time, 0.0})));
    } else if (k == 1) {
        total = of->rate;
    }
    for (int n = 0; n < of->n_waves; n++) {
        const wave_t *wave = &of->waves[n];
        pair_t weight = pair_product(wave->weight[k], k % 2 ? wave->cosine : wave->sine);
        if (k % 4 > 1)
            weight = (pair_t){-weight.hi, -weight.lo};
        gather(&total, wave->amplitude, all(weight));
    }
    return tidy(total);
}

static void put_attitude(series_t *s, int k, vector_t q, int in_space) {
    s->q[k] = q;
    by_units(q, s->q_units[k]);
    if (in_space)
        by_units(conjugate(q), s->back_units[k]);
}

/* Term k of the torque about the body's axes: conjugate of q, torque, q. */
static vector_t torque_in_body(series_t *s, int k) {
    vector_t total = {{0.0}, {0.0}};
    for (int j = 0; j <= k; j++)
        for (int i = 0; i < 3; i++)
            gather(&total, s->back_units[j][i], part(s->torque[k - j], i));
    s->middle[k] = tidy(total);
    by_units(s->middle[k], s->middle_units[k]);
    total = (vector_t){{0.0}, {0.0}};
    for (int j = 0; j <= k; j++) {
        gather(&total, s->middle[j], part(s->q[k - j], 0));
        for (int i = 0; i < 3; i++)
            gather(&total, s->middle_units[j][i], part(s->q[k - j], i + 1));
    }
    total = tidy(total);
    return (vector_t){{total.hi[1], total.hi[2], total.hi[3], 0.0},
                      {total.lo[1], total.lo[2], total.lo[3], 0.0}};
}

/* From the terms 0 of omega and attitude. */
static void expand(const problem_t *of, double time, series_t *s) {
    const pair_t half = {0.5, 0.0};
    if (of->body == OF_INERTIA)
        put(s->momentum[0], times(of->inertia, s->w[0][0]));
    for (int k = 0; k < ORDER; k++) {
        s->torque[k] = torque_term(of, k, time);
        s->pushed[k] = of->in_space ? torque_in_body(s, k) : s->torque[k];
        vector_t total = {{0.0}, {0.0}};
        if (of->body == OF_INERTIA) {
            for (int j = 0; j <= k; j++)
                gather_cross(&total, s->momentum[j], s->w[k - j]);
            const vector_t change =
                product(sum(tidy(total), s->pushed[k]), all(of->reciprocals[k + 1]));
            put(s->w[k + 1], times(of->inverse, change));
            put(s->momentum[k + 1], change);
        } else {
            for (int j = 0; j <= k; j++)
                gather(&total, s->w[j][1], s->w[k - j][2]);
            total = sum(product(tidy(total), of->products), s->pushed[k]);
            put(s->w[k + 1], product(total, all(of->reciprocals[k + 1])));
        }
        if (of->with_attitude) {
            total = (vector_t){{0.0}, {0.0}};
            for (int j = 0; j <= k; j++)
                for (int i = 0; i < 3; i++)
                    gather(&total, s->q_units[j][i], part(s->w[k - j][0], i));
            total = product(tidy(total), all(pair_product(half, of->reciprocals[k + 1])));
            put_attitude(s, k + 1, total, of->in_space);
        }
    }
}

static int is_finite(vector_t a) {
    return isfinite(a.hi[0]) && isfinite(a.hi[1]) && isfinite(a.hi[2]) && isfinite(a.hi[3]);
}

static double size_of(vector_t a) { return fmax(size(a), fabs(a.hi[3])); }

/* Longest step for which the last terms are small beside the first ones; 0 where they are no
   numbers. `apart` is the distance between terms. */
static double step_of(const vector_t *terms, int apart) {
    double length = INFINITY;
    for (int k = ORDER - LAST + 1; k <= ORDER; k++) {
        const double last = size_of(terms[k * apart]);
        double longest = 0.0;
        if (!is_finite(terms[k * apart]))
            return 0.0;
        for (int j = 0; j < 4; j++) {
            const double early = size_of(terms[j * apart]);
            if (last > 0.0 && early > 0.0)
                longest = fmax(longest, exp(log(SMALL * early / last) / (k - j)));
        }
        if (last > 0.0)
            length = fmin(length, CAUTION * longest);
    }
    return length;
}

static vector_t value_at(const vector_t *terms, int apart, double step) {
    const vector_t by = all((pair_t){step, 0.0});
    vector_t found = terms[ORDER * apart];
    for (int k = ORDER - 1; k >= 0; k--)
        found = sum(product(found, by), terms[k * apart]);
    return found;
}

static lanes_t rough_at(const vector_t *terms, int apart, int order, double step) {
    lanes_t found = terms[order * apart].hi;
    for (int k = order - 1; k >= 0; k--)
        found = found * same(step) + terms[k * apart].hi;
    return found;
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

static void cross_matrix(lanes_t a, double (*m)[3]) {
    m[0][0] = m[1][1] = m[2][2] = 0.0;
    m[0][1] = -a[2], m[1][0] = a[2];
    m[0][2] = a[1], m[2][0] = -a[1];
    m[1][2] = -a[0], m[2][1] = a[0];
}

/* Jacobian of (omega, small rotation about the body's axes) at a time within a step. */
static void jacobian(const problem_t *of, const series_t *s, double at, double (*found)[LINEAR]) {
    const lanes_t w = rough_at(&s->w[0][0], 3, ORDER, at);
    double top[3][3] = {{0.0}}, beside[3][3] = {{0.0}}, turn_w[3][3];
    cross_matrix(w, turn_w);
    if (of->body == OF_INERTIA) {
        const lanes_t momentum = rough_at(&s->momentum[0][0], 3, ORDER, at);
        double turn_l[3][3], turn_n[3][3], inside[3][3];
        cross_matrix(momentum, turn_l);
        /* d(L x w) = L x dw - w x J dw; of the torque N in space N_b x rotation. */
        for (int i = 0; i < 3; i++)
            for (int j = 0; j < 3; j++) {
                inside[i][j] = turn_l[i][j];
                for (int n = 0; n < 3; n++)
                    inside[i][j] -= turn_w[i][n] * of->inertia[j].hi[n];
            }
        cross_matrix(of->in_space ? rough_at(s->pushed, 1, ORDER - 1, at) : same(0.0), turn_n);
        for (int i = 0; i < 3; i++)
            for (int j = 0; j < 3; j++)
                for (int n = 0; n < 3; n++) {
                    top[i][j] += of->inverse[n].hi[i] * inside[n][j];
                    beside[i][j] += of->inverse[n].hi[i] * turn_n[n][j];
                }
    } else {
        for (int i = 0; i < 3; i++) {
            const int j = (i + 1) % 3, k = (i + 2) % 3;
            top[i][j] = of->products.hi[i] * w[k];
            top[i][k] = of->products.hi[i] * w[j];
        }
    }
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) {
            found[i][j] = top[i][j];
            found[i][j + 3] = beside[i][j];
            found[i + 3][j] = i == j && of->with_attitude;
            found[i + 3][j + 3] = of->with_attitude ? -turn_w[i][j] : 0.0;
        }
}

static double row_sum(double (*a)[LINEAR]) {
    double most = 0.0;
    for (int i = 0; i < 3; i++) {
        double row = 0.0;
        for (int j = 0; j < LINEAR; j++)
            row += fabs(a[i][j]);
        most = fmax(most, row);
    }
    return most;
}

typedef double flow_t[LINEAR][LINEAR];

static void apply(double (*a)[LINEAR], double (*b)[LINEAR], double (*found)[LINEAR]) {
    flow_t c;
    for (int i = 0; i < LINEAR; i++)
        for (int j = 0; j < LINEAR; j++) {
            c[i][j] = 0.0;
            for (int n = 0; n < LINEAR; n++)
                c[i][j] += a[i][n] * b[n][j];
        }
    for (int i = 0; i < LINEAR; i++)
        for (int j = 0; j < LINEAR; j++)
            found[i][j] = c[i][j];
}

static void add(double (*a)[LINEAR], double by, double (*b)[LINEAR], double (*found)[LINEAR]) {
    for (int i = 0; i < LINEAR; i++)
        for (int j = 0; j < LINEAR; j++)
            found[i][j] = a[i][j] + by * b[i][j];
}

/* Derivative of the end of a step by its beginning. */
static void flow_over(const problem_t *of, const series_t *s, double step, flow_t flow) {
    flow_t begin, middle, end, k1, k2, k3, k4, at;
    for (int i = 0; i < LINEAR; i++)
        for (int j = 0; j < LINEAR; j++)
            flow[i][j] = i == j;
    jacobian(of, s, 0.0, begin);
    jacobian(of, s, step, end);
    jacobian(of, s, 0.5 * step, middle);
    const double norm = fmax(row_sum(begin), fmax(row_sum(middle), row_sum(end)));
    const double wanted = ceil(fabs(step) * norm / LINEAR_STEP);
    const int count = (int)fmin(1e5, fmax(2.0, wanted));
    const double h = step / count;
    for (int n = 0; n < count; n++) {
        jacobian(of, s, (n + 0.5) * h, middle);
        jacobian(of, s, (n + 1.0) * h, end);
        apply(begin, flow, k1);
        add(flow, 0.5 * h, k1, at);
        apply(middle, at, k2);
        add(flow, 0.5 * h, k2, at);
        apply(middle, at, k3);
        add(flow, h, k3, at);
        apply(end, at, k4);
        add(flow, h / 6.0, k1, flow);
        add(flow, h / 3.0, k2, flow);
        add(flow, h / 3.0, k3, flow);
        add(flow, h / 6.0, k4, flow);
        add(end, 0.0, end, begin);
    }
}

/* 2-norm, omega in units of `scale`; of omega alone without the attitude. */
static double norm_of(double (*a)[LINEAR], double scale, int with_attitude) {
    const int n = with_attitude ? LINEAR : 3;
    double b[LINEAR][LINEAR], x[LINEAR], y[LINEAR], most = 0.0, found = 0.0;
    for (int i = 0; i < n; i++)
        for (int j = 0; j < n; j++) {
            b[i][j] = a[i][j] * ((i < 3) == (j < 3) ? 1.0 : i < 3 ? 1.0 / scale : scale);
            if (!(fabs(b[i][j]) <= most))
                most = fabs(b[i][j]);
        }
    if (!(most < 1e300))
        return INFINITY;
    for (int i = 0; i < n; i++)
        x[i] = 1.0 + 0.1 * i;
    for (int round = 0; round < ITERATIONS; round++) {
        double length = 0.0;
        for (int i = 0; i < n; i++) {
            y[i] = 0.0;
            for (int j = 0; j < n; j++)
                y[i] += b[i][j] / most * x[j];
        }
        for (int j = 0; j < n; j++) {
            x[j] = 0.0;
            for (int i = 0; i < n; i++)
                x[j] += b[i][j] / most * y[i];
            length += x[j] * x[j];
        }
        length = sqrt(length);
        found = most * sqrt(length);
        for (int j = 0; j < n; j++)
            x[j] /= length;
    }
    return found;
}

static double growth_until(flow_t *flows, int steps, double scale, int with_attitude) {
    double growth = 1.0;
    flow_t flow = {{0.0}};
    for (int i = 0; i < LINEAR; i++)
        flow[i][i] = 1.0;
    for (int n = steps - 1; n >= 0 && growth < INFINITY; n--) {
        apply(flow, flows[n], flow);
        growth = fmax(growth, norm_of(flow, scale, with_attitude));
    }
    return growth;
}

static int begin(problem_t *of, const double *body, const double *constant, const double *rate,
                 const double *given, double *cap) {
    of->constant = read(constant);
    of->rate = read(rate);
    if (of->body == OF_COEFFICIENTS)
        of->products = read(body);
    else
        for (int i = 0; i < 3; i++) {
            of->inertia[i] = read(body + 6 * i);
            of->inverse[i] = read(body + 18 + 6 * i);
        }
    for (int k = 1; k <= ORDER; k++)
        of->reciprocals[k] = reciprocal(k);
    of->waves = aligned_alloc(32, sizeof(wave_t) * (of->n_waves + 1));
    *cap = INFINITY;
    if (!of->waves)
        return NO_MEMORY;
    for (int n = 0; n < of->n_waves; n++) {
        wave_t *wave = &of->waves[n];
        const double *from = given + 8 * n;
        wave->amplitude = read(from);
        wave->frequency = from[6];
        wave->sine = (pair_t){from[7] != 0.0 ? 1.0 : 0.0, 0.0};
        wave->cosine = (pair_t){from[7] != 0.0 ? 0.0 : 1.0, 0.0};
        wave->weight[0] = (pair_t){1.0, 0.0};
        for (int k = 1; k <= ORDER; k++) {
            const pair_t factor = pair_product(of->reciprocals[k], (pair_t){wave->frequency, 0.0});
            wave->weight[k] = pair_product(wave->weight[k - 1], factor);
        }
        if (wave->frequency != 0.0)
            *cap = fmin(*cap, MOST_ANGLE / fabs(wave->frequency));
    }
    return COMPLETE;
}

/* Vectors are large parts and then small ones. A body is A, B, C, or the columns of J and then those
   of its inverse; a wave is amplitude, frequency, and whether it is a cosine. The
   times lead away from 0 on one side, all of them whole units of the last. A row is omega (6), attitude (8) and the error amplification until then; `found` is
   the largest omega so far and the angle of rotation. */
int pairs_truth(int body_kind, const double *body, const double *constant, const double *rate,
                int n_waves, const double *given, int with_attitude, int in_space,
                const double *omega, const double *attitude, int n_times, const double *until,
                int most_steps, double *rows, double *found, int *steps) {
    problem_t of = {.body = body_kind, .n_waves = n_waves, .with_attitude = with_attitude,
                    .in_space = in_space};
    series_t *s = aligned_alloc(32, (sizeof(series_t) + 31) / 32 * 32);
    double cap = INFINITY;
    int status = begin(&of, body, constant, rate, given, &cap), most = 0, row = 0;
    double time = 0.0, angle = 0.0;
    const double end = until[n_times - 1];
    const double sign = end < 0.0 ? -1.0 : 1.0, unit = ldexp(1.0, ilogb(end) - 52);
    flow_t *flows = NULL;
    int *steps_until = calloc(n_times, sizeof(int));

    *steps = 0;
    if (!s || !steps_until)
        status = NO_MEMORY;
    if (status == COMPLETE) {
        put(s->w[0], (vector_t){{omega[0], omega[1], omega[2], 0.0}, {0.0}});
        s->q[0] = (vector_t){{0.0}, {0.0}};
        if (with_attitude)
            for (int i = 0; i < 4; i++) {
                s->q[0].hi[i] = attitude[i];
                s->q[0].lo[i] = attitude[i + 4];
            }
        put_attitude(s, 0, s->q[0], in_space);
    }
    double largest = status == COMPLETE ? size(s->w[0][0]) : 0.0;
    while (status == COMPLETE && row < n_times) {
        if (*steps == most_steps) {
            status = TOO_MANY_STEPS;
            break;
        }
        if (*steps == most) {
            most = most ? 2 * most : 256;
            flow_t *more = realloc(flows, sizeof(*flows) * most);
            if (!more) {
                status = NO_MEMORY;
                break;
            }
            flows = more;
        }
        expand(&of, time, s);
        /* Whole units, so that neither the time nor the rest of it is ever rounded. */
        const double rest = fabs(until[row] - time);
        double length = fmin(step_of(&s->w[0][0], 3), cap);
        if (with_attitude)
            length = fmin(length, step_of(s->q, 1));
        length = length < rest ? floor(length / unit) * unit : rest;
        if (!(length > 0.0)) {
            status = NO_BOUND;
            break;
        }
        const double step = sign * length;
        flow_over(&of, s, step, flows[*steps]);
        for (int i = 1; i <= INSIDE; i++) {
            lanes_t there = rough_at(&s->w[0][0], 3, ORDER, step * i / INSIDE);
            largest = fmax(largest, size((vector_t){there, {0.0}}));
            there *= there;
            angle += length / INSIDE * sqrt(there[0] + there[1] + there[2]);
        }
        const vector_t w = value_at(&s->w[0][0], 3, step);
        put(s->w[0], w);
        if (with_attitude)
            put_attitude(s, 0, value_at(s->q, 1, step), in_space);
        for (int n = 0; n < n_waves; n++)
            turn_wave(&of.waves[n], step);
        largest = is_finite(w) ? fmax(largest, size(w)) : INFINITY;
        ++*steps;
        if (!(largest < 1e100)) {
            status = NO_BOUND;
            break;
        }
        if (length < rest) {
            time += step;
            continue;
        }
        time = until[row];
        for (int i = 0; i < 3; i++) {
            rows[15 * row + i] = w.hi[i];
            rows[15 * row + 3 + i] = w.lo[i];
        }
        for (int i = 0; i < 4; i++) {
            rows[15 * row + 6 + i] = s->q[0].hi[i];
            rows[15 * row + 10 + i] = s->q[0].lo[i];
        }
        steps_until[row] = *steps;
        row++;
    }
    for (int n = 0; n < n_times && status == COMPLETE; n++)
        rows[15 * n + 14] = growth_until(flows, steps_until[n], largest, with_attitude);
    found[0] = largest;
    found[1] = angle;
    free(steps_until);
    free(flows);
    free(of.waves);
    free(s);
    return status;
}
