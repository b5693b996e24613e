/* The Bouc-Wen operator by hand: h' = A u' - B |u'| h - G u' |h|, y = D u - h, one Runge-Kutta step a sample.
   usage: bouc_wen SAMPLES REPS IN OUT D A B G PERIOD; compiled by `cargo xtask bench` with cc -O3. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

static double now(clockid_t clock) {
    struct timespec t;
    clock_gettime(clock, &t);
    return t.tv_sec + 1e-9 * t.tv_nsec;
}

static void loop(const double *u, double *y, long n, double d, double a, double b, double g, double period) {
    double h = 0;
    y[0] = d * u[0] - h;
    for (long k = 1; k < n; k++) {
        double v = (u[k] - u[k - 1]) / period, w = fabs(v);
        double k1 = a * v - b * w * h - g * v * fabs(h);
        double x = h + 0.5 * period * k1;
        double k2 = a * v - b * w * x - g * v * fabs(x);
        x = h + 0.5 * period * k2;
        double k3 = a * v - b * w * x - g * v * fabs(x);
        x = h + period * k3;
        double k4 = a * v - b * w * x - g * v * fabs(x);
        h += period / 6 * (k1 + 2 * k2 + 2 * k3 + k4);
        y[k] = d * u[k] - h;
    }
}

int main(int argc, char **argv) {
    if (argc < 10) return 2;
    long n = atol(argv[1]), reps = atol(argv[2]);
    double *u = malloc(n * sizeof *u), *y = malloc(n * sizeof *y);
    double *cpu = malloc(reps * sizeof *cpu), *wall = malloc(reps * sizeof *wall);
    FILE *file = fopen(argv[3], "rb");
    if (!u || !y || !cpu || !wall || !file || fread(u, sizeof *u, n, file) != (size_t)n) return 1;
    fclose(file);
    for (long r = 0; r < reps; r++) {
        double wall0 = now(CLOCK_MONOTONIC), cpu0 = now(CLOCK_PROCESS_CPUTIME_ID);
        loop(u, y, n, atof(argv[5]), atof(argv[6]), atof(argv[7]), atof(argv[8]), atof(argv[9]));
        cpu[r] = now(CLOCK_PROCESS_CPUTIME_ID) - cpu0;
        wall[r] = now(CLOCK_MONOTONIC) - wall0;
    }
    file = fopen(argv[4], "wb");
    if (!file || fwrite(y, sizeof *y, n, file) != (size_t)n) return 1;
    fclose(file);
    printf("{\"samples\": %ld, \"cpu_s\": [", n);
    for (long r = 0; r < reps; r++) printf("%s%.9f", r ? ", " : "", cpu[r]);
    printf("], \"wall_s\": [");
    for (long r = 0; r < reps; r++) printf("%s%.9f", r ? ", " : "", wall[r]);
    printf("]}\n");
    return 0;
}
