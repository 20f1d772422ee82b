/* The three programs of the thesis as a port: each line of standard input requests a run, and each
   line of standard output has its results. The guide "Ports" of rigid-body-harness describes the
   fields of both. Every statement keeps the order of operations of the printed programs. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { POINTS = 4, SINGULAR = 129 };

typedef struct {
    double amplitude[3], frequency;
    int is_cosine;
} Wave;

typedef struct {
    double moments[3], coefficients[3], omega[3], masses[3], forces[3], initial_torque[3];
    double constant[3], rate[3], step_size, lipschitz;
    Wave *waves;
    int n_waves, varies, has_moments, has_initial_torque, steps, may_stop;
    const char *listing; /* the part of the request that names the active defects */
} Request;

static void fail(const char *what, const char *name) {
    fprintf(stderr, "port: error: %s '%s'\n", what, name);
    exit(2);
}

/* Return the place of a field's value, or NULL. Within a JSON string every quote follows a
   backslash. Therefore "name": is only found where it is the name of a field. */
static const char *find(const char *text, const char *name) {
    for (size_t n = strlen(name); (text = strchr(text, '"')) != NULL; text++)
        if (strncmp(text + 1, name, n) == 0 && strncmp(text + 1 + n, "\":", 2) == 0)
            return text + n + 3 + strspn(text + n + 3, " ");
    return NULL;
}

static const char *field(const char *text, const char *name) {
    const char *value = find(text, name);
    if (value == NULL) fail("the request lacks the field", name);
    return value;
}

static double number(const char *text, const char *name) { return strtod(field(text, name), NULL); }

/* Read a list of three numbers; return 0 if the field is missing or null. */
static int three(const char *text, const char *name, double x[3]) {
    const char *at = find(text, name);
    if (at == NULL || *at != '[') return 0;
    for (int i = 0; i < 3; i++) {
        char *end;
        x[i] = strtod(at + 1, &end); /* after a bracket or a comma */
        at = end;
    }
    return 1;
}

static void read_waves(Request *r, const char *list, int is_cosine) {
    for (const char *at = list + 1; *at == '{'; at = strchr(at, '}') + 1, at += strspn(at, ", ")) {
        r->waves = realloc(r->waves, (size_t)(r->n_waves + 1) * sizeof *r->waves);
        if (r->waves == NULL) fail("no memory for", "waves");
        Wave *wave = &r->waves[r->n_waves++];
        wave->is_cosine = is_cosine;
        wave->frequency = number(at, "frequency");
        three(at, "amplitude", wave->amplitude);
        for (int i = 0; i < 3; i++) r->varies |= wave->amplitude[i] != 0.0;
    }
}

static Request read_request(const char *line) {
    Request r = {0};
    if (number(line, "schema") != 1.0) fail("this port reads only", "schema 1");
    r.listing = field(line, "listing");
    r.step_size = number(line, "step_size");
    r.steps = (int)number(line, "steps");
    r.lipschitz = number(line, "lipschitz");
    r.may_stop = *field(line, "may_stop") == 't';
    three(line, "omega", r.omega);
    three(line, "masses", r.masses);
    three(line, "forces", r.forces);
    three(line, "constant", r.constant);
    three(line, "rate", r.rate);
    r.has_initial_torque = three(line, "initial_torque", r.initial_torque);
    read_waves(&r, field(line, "sines"), 0);
    read_waves(&r, field(line, "cosines"), 1);
    for (int i = 0; i < 3; i++) r.varies |= r.rate[i] != 0.0;
    r.has_moments = three(line, "moments", r.moments);
    if (!r.has_moments) three(line, "coefficients", r.coefficients);
    for (int i = 0; r.has_moments && i < 3; i++) /* equations 13 to 15 */
        r.coefficients[i] = (r.moments[(i + 1) % 3] - r.moments[(i + 2) % 3]) / r.moments[i];
    return r;
}

/* Return whether a defect, reading or conjecture is active: a list of `listing` has its name. */
static int has(const Request *r, const char *name) {
    const char *end = strchr(r->listing, '}'), *at = strstr(r->listing, name);
    while (at != NULL && at < end && (at[-1] != '"' || at[strlen(name)] != '"'))
        at = strstr(at + 1, name);
    return at != NULL && at < end;
}

/* Set the torque over moment (rad/s2) at n times of a step that ends when the program has TIME. */
static void set_torques(const Request *r, int step, double TIME, int n, const double *times,
                        double torques[][3]) {
    int first = step == 0 && r->has_initial_torque && r->has_moments && has(r, "initial-torque");
    for (int k = 0; k < n; k++) {
        double t = has(r, "torque-held") ? TIME : times[k];
        for (int i = 0; i < 3; i++) {
            double torque = r->constant[i];
            if (r->varies) torque = torque + r->rate[i] * t;
            for (int w = 0; r->varies && w < r->n_waves; w++) {
                double angle = r->waves[w].frequency * t;
                double wave = r->waves[w].is_cosine ? cos(angle) : sin(angle);
                torque = torque + r->waves[w].amplitude[i] * wave;
            }
            if (first) torque = r->initial_torque[i];
            torques[k][i] = r->has_moments ? torque / r->moments[i] : torque;
        }
    }
}

static void accelerations(const Request *r, double a[3]) {
    int own = has(r, "three-masses");
    for (int i = 0; i < 3; i++) a[i] = r->forces[i] / r->masses[own ? i : 0];
}

static void velocity_rates(const double a[3], const double x[6], double rates[6]) {
    rates[3] = a[0] + x[4] * x[2] - x[5] * x[1];
    rates[4] = a[1] + x[5] * x[0] - x[3] * x[2];
    rates[5] = a[2] + x[3] * x[1] - x[4] * x[0];
}

static int is_finite(const double x[6]) {
    return isfinite(x[0]) && isfinite(x[1]) && isfinite(x[2]);
}

static void print_row(int row, double time, const double x[6]) {
    printf("%s[\"%a\"", row ? ", " : "", time);
    for (int i = 0; i < 6; i++) printf(", \"%a\"", x[i]);
    printf("]");
}

/* Return IER. If it is 0, the solutions of a x = b replace the six columns of b. */
static int leqt1f(int n, double a[][POINTS], double b[][6]) {
    double scale[POINTS], kept[POINTS];
    int pivots[POINTS];
    for (int i = 0; i < n; i++) {
        double biggest = 0.0;
        for (int j = 0; j < n; j++) biggest = fmax(biggest, fabs(a[i][j]));
        if (biggest == 0.0) return SINGULAR;
        scale[i] = 1.0 / biggest;
    }
    for (int j = 0; j < n; j++) {
        double biggest = 0.0;
        pivots[j] = j;
        for (int i = 0; i < n; i++) {
            for (int k = 0; k < i && k < j; k++) a[i][j] = a[i][j] - a[i][k] * a[k][j];
            if (i >= j && scale[i] * fabs(a[i][j]) > biggest) {
                biggest = scale[i] * fabs(a[i][j]);
                pivots[j] = i;
            }
        }
        if (n + biggest == n) return SINGULAR;
        memcpy(kept, a[j], sizeof kept);
        memmove(a[j], a[pivots[j]], sizeof kept);
        memcpy(a[pivots[j]], kept, sizeof kept);
        scale[pivots[j]] = scale[j];
        for (int i = j + 1; i < n; i++) a[i][j] = a[i][j] / a[j][j];
    }
    for (int u = 0; u < 6; u++) {
        for (int i = 0; i < n; i++) {
            double total = b[pivots[i]][u];
            b[pivots[i]][u] = b[i][u];
            for (int k = 0; k < i; k++) total = total - a[i][k] * b[k][u];
            b[i][u] = total;
        }
        for (int i = n - 1; i >= 0; i--) {
            for (int k = i + 1; k < n; k++) b[i][u] = b[i][u] - a[i][k] * b[k][u];
            b[i][u] = b[i][u] / a[i][i];
        }
    }
    return 0;
}

/* Replace the rates b at n points t by the coefficients of the polynomials; return IER. */
static int fit(int n, const double *t, double b[][6]) {
    double a[POINTS][POINTS];
    for (int k = 0; k < n; k++) {
        double t2 = t[k] * t[k], row[POINTS] = {1.0, 2.0 * t[k], 3.0 * t2, 4.0 * (t2 * t[k])};
        memcpy(a[k], row, sizeof row);
    }
    return leqt1f(n, a, b);
}

static void polynomials(int n, const double start[6], double c[][6], double t, double x[6]) {
    double t2 = t * t, powers[POINTS] = {t, t2, t2 * t, t2 * t2};
    for (int i = 0; i < 6; i++) {
        x[i] = start[i];
        for (int k = 0; k < n; k++) x[i] = x[i] + c[k][i] * powers[k];
    }
}

/* The collocation programs: n is 2 or 4. Index 0 is the start of a step, 1 to n are its points. */
static void collocation(const Request *r, int n) {
    static const double fractions[] = {0.0, 0.2, 0.4, 0.6, 0.8};
    const double *e = r->coefficients;
    double x[6] = {r->omega[0], r->omega[1], r->omega[2]};
    double h = r->step_size, dt = h, time = 0.0, a[3];
    int step = 0, *ier = calloc((size_t)r->steps, sizeof *ier);
    if (ier == NULL) fail("no memory for", "IER");
    accelerations(r, a);
    for (; step < r->steps; step++) {
        double t[1 + POINTS], times[1 + POINTS], torques[1 + POINTS][3];
        double estimate[POINTS][6], rates[1 + POINTS][6], at[6], next[6];
        time = time + dt;
        for (int k = 0; k <= n; k++) {
            t[k] = n == 4 ? dt * fractions[k] : k * dt / 3.0;
            times[k] = step * h + t[k];
        }
        set_torques(r, step, time, n + 1, times, torques);
        for (int k = 0; k <= n; k++) {
            double c = n == 2 && k == 0 && has(r, "c1-for-c") ? 0.0 : e[2];
            double a1 = n == 2 && k == 2 && has(r, "x3-reads-acl2") ? a[1] : a[0];
            polynomials(k == 0 ? 0 : n, x, estimate, t[k], at);
            rates[k][0] = torques[k][0] + e[0] * at[1] * at[2];
            rates[k][1] = torques[k][1] + e[1] * at[0] * at[2];
            rates[k][2] = torques[k][2] + c * at[0] * at[1];
            velocity_rates((double[]){a1, a[1], a[2]}, at, rates[k]);
            if (k == 0) { /* the first estimate has constant rates */
                for (int p = 0; p < n; p++) memcpy(estimate[p], rates[0], sizeof estimate[p]);
                fit(n, t + 1, estimate);
            }
        }
        ier[step] = fit(n, t + 1, rates + 1);
        polynomials(n, x, rates + 1, h, next);
        if (!is_finite(next)) break;
        memcpy(x, next, sizeof x);
        print_row(step, time, x);
        if (has(r, "dt-accumulates")) dt = dt + h;
    }
    const char *ended = step < r->steps ? "overflow" : "complete";
    printf("], \"ended\": \"%s\", \"stop\": null, \"ier\": [", ended);
    for (int i = 0; i < step; i++) printf("%s%d", i ? ", " : "", ier[i]);
    printf("]}\n");
    free(ier);
}

static double norm(int n, const double *x) {
    double total = 0.0;
    for (int i = 0; i < n; i++) total = total + x[i] * x[i];
    return sqrt(total);
}

/* Return the unknown that violates equation 19 and set its quotient, or return NULL. */
static const char *violation(const Request *r, const double *dk, const double *du, double *q) {
    static const char *const names[] = {"U1", "U2", "U3", "V1", "V2", "V3"};
    int n = has(r, "lipschitz-tests-velocity") ? 6 : 3, single = has(r, "lipschitz-per-component");
    for (int i = 0; i < (single ? n : 1); i++) {
        int u = (i + 3) % n; /* the velocity is tested first */
        double change = single ? dk[u] : norm(n, dk), by = single ? du[u] : norm(n, du);
        *q = by == 0.0 ? INFINITY : change / by;
        if (change > by * r->lipschitz) return single ? names[u] : n == 6 ? "UV" : "U";
    }
    return NULL;
}

/* The Runge-Kutta program. Points and rates have its own indices, 1 to 4. */
static void runge_kutta(const Request *r) {
    const double *e = r->coefficients;
    double h = r->step_size, time = 0.0, a[3], point[5][6] = {{0.0}}, rates[5][6] = {{0.0}};
    double base[6] = {r->omega[0], r->omega[1], r->omega[2]}, quotient = 0.0;
    int third = has(r, "do-variable") ? 4 : 3, step = 0;
    const int result[] = {1, 2, third, 4}, from[] = {1, 1, 2, 3}; /* indices in the four stages */
    const char *variable = NULL, *ended = "complete";
    memcpy(point[1], base, sizeof base);
    accelerations(r, a);
    while (step < r->steps && variable == NULL) {
        double begin = step * h, middle = begin + 0.5 * h, torques[4][3];
        double first[6], next[6], du[6], dk[6];
        time = time + h;
        set_torques(r, step, time, 4, (double[]){begin, middle, middle, begin + h}, torques);
        memcpy(first, point[1], sizeof first);
        for (int s = 0; s < 4; s++) {
            double *x = point[from[s]], *k = rates[result[s]], *m = torques[result[s] - 1];
            k[0] = m[0] + e[0] * x[1] * x[2];
            k[1] = m[1] + e[1] * x[2] * x[0];
            k[2] = m[2] + e[2] * x[0] * x[1];
            velocity_rates(a, x, k);
            const double *start = has(r, "stage-base") ? x : base;
            for (int i = 0; s < 3 && i < 6; i++)
                point[result[s]][i] = start[i] + (s < 2 ? 0.5 * h : h) * k[i];
        }
        for (int i = 0; i < 6; i++) { /* equation 31 */
            double middles = 2.0 * (rates[2][i] + rates[3][i]);
            next[i] = base[i] + (h / 6.0) * (rates[1][i] + middles + rates[4][i]);
            int pairs = has(r, "lipschitz-mismatched-pairs");
            du[i] = pairs ? fabs(next[i] - base[i]) : fabs(point[3][i] - first[i]);
            dk[i] = fabs(rates[4][i] - rates[1][i]);
        }
        if (!is_finite(next)) {
            ended = "overflow";
            break;
        }
        print_row(step++, time, next);
        if (r->may_stop) variable = violation(r, dk, du, &quotient);
        memcpy(point[4], next, sizeof next);
        memcpy(base, next, sizeof next);
        if (!has(r, "base-not-restored")) memcpy(point[1], next, sizeof next);
    }
    printf("], \"ended\": \"%s\", \"ier\": null, \"stop\": ", variable ? "stopped" : ended);
    if (variable == NULL) printf("null}\n");
    else
        printf("{\"step\": %d, \"variable\": \"%s\", \"quotient\": \"%a\"}}\n", step, variable,
               quotient);
}

/* Read a line of any length; return 0 at the end of the input. */
static int read_line(char **line, size_t *size) {
    size_t length = 0;
    for (int c; (c = getchar()) != EOF && c != '\n'; (*line)[length] = '\0') {
        if (length + 2 > *size) *line = realloc(*line, *size = 2 * *size + 4096);
        if (*line == NULL) fail("no memory for", "a request");
        (*line)[length++] = (char)c;
    }
    return length > 0;
}

int main(void) {
    char *line = NULL;
    size_t size = 0;
    while (read_line(&line, &size)) {
        Request r = read_request(line);
        char program = field(line, "program")[1]; /* two-term, four-term or runge-kutta */
        printf("{\"rows\": [");
        if (program == 'r') runge_kutta(&r);
        else collocation(&r, program == 't' ? 2 : 4);
        fflush(stdout);
        free(r.waves);
    }
    free(line);
    return 0;
}
