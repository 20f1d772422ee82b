/* Lorenz's equations, by the Runge-Kutta method of order 4. */
#include <stdio.h>

static void slope(const double *y, double *f) {
  f[0] = 10.0 * (y[1] - y[0]);
  f[1] = y[0] * (28.0 - y[2]) - y[1];
  f[2] = y[0] * y[1] - 8.0 / 3.0 * y[2];
}

int main(void) {
  double y[3], p[3], k[4][3], h = 0.01, part[] = {0.0, 0.5, 0.5, 1.0};
  int steps, n, s, i;
  if (scanf("%lf %lf %lf %d", y, y + 1, y + 2, &steps) != 4) return 1;
  for (n = 1; n <= steps; n++) {
    for (s = 0; s < 4; s++) {
      for (i = 0; i < 3; i++) p[i] = s ? y[i] + part[s] * h * k[s - 1][i] : y[i];
      slope(p, k[s]);
    }
    for (i = 0; i < 3; i++)
      y[i] += h / 6.0 * (k[0][i] + 2.0 * k[1][i] + 2.0 * k[2][i] + k[3][i]);
    printf("%.2f %.17g %.17g %.17g\n", n * h, y[0], y[1], y[2]);
  }
  return 0;
}
