/* Factors a symmetric matrix with MUMPS: processor time and memory, beside `indefinite` of runtime/sparse/examples.
   cc -O2 mumps_factor.c -ldmumps -lmpi -o mumps_factor && ./mumps_factor FILE sym [ordering]
   FILE is in the format of Matrix Market, lower half; sym is 2 (LDLT) or 0 (LU). */
#include <dmumps_c.h>
#include <mpi.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

static double used(void)
{
    struct timespec t;
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
    return t.tv_sec + 1e-9 * t.tv_nsec;
}

static double peak(void)
{
    char line[256];
    double kilobytes = 0;
    FILE *f = fopen("/proc/self/status", "r");
    while (f && fgets(line, sizeof line, f))
        if (sscanf(line, "VmHWM: %lf", &kilobytes) == 1)
            break;
    if (f)
        fclose(f);
    return kilobytes * 1024;
}

int main(int argc, char **argv)
{
    char line[256];
    int n, m;
    long long k, count, entries = 0;
    if (argc < 3)
        return 1;
    MPI_Init(&argc, &argv);
    FILE *f = fopen(argv[1], "r");
    int sym = atoi(argv[2]);
    while (f && fgets(line, sizeof line, f) && line[0] == '%')
        ;
    if (!f || sscanf(line, "%d %d %lld", &n, &m, &count) != 3)
        return 1;
    int *rows = malloc(2 * count * sizeof(int)), *columns = malloc(2 * count * sizeof(int));
    double *values = malloc(2 * count * sizeof(double)), *x = calloc(n, sizeof(double)), *b = calloc(n, sizeof(double));
    for (k = 0; k < count; k++) {
        int i, j;
        double v;
        if (fscanf(f, "%d %d %lf", &i, &j, &v) != 3)
            return 1;
        double wj = 1 + (j - 1) % 7, wi = 1 + (i - 1) % 7;
        b[i - 1] += v * wj;
        if (i != j)
            b[j - 1] += v * wi;
        rows[entries] = i, columns[entries] = j, values[entries++] = v;
        if (!sym && i != j)
            rows[entries] = j, columns[entries] = i, values[entries++] = v;
    }
    memcpy(x, b, n * sizeof(double));
    double before = peak();
    DMUMPS_STRUC_C id;
    memset(&id, 0, sizeof id);
    id.job = -1, id.par = 1, id.sym = sym, id.comm_fortran = -987654;
    dmumps_c(&id);
    id.icntl[0] = id.icntl[1] = id.icntl[2] = -1, id.icntl[3] = 0;
    id.icntl[13] = 50;
    if (argc > 3)
        id.icntl[6] = atoi(argv[3]);
    id.n = n, id.nnz = entries, id.irn = rows, id.jcn = columns, id.a = values, id.rhs = x;
    double t0 = used();
    id.job = 1, dmumps_c(&id);
    double t1 = used();
    id.job = 2, dmumps_c(&id);
    double t2 = used();
    id.job = 2, dmumps_c(&id);
    double t3 = used();
    id.job = 3, dmumps_c(&id);
    double t4 = used(), error = 0;
    for (k = 0; k < n; k++)
        error = fmax(error, fabs(x[k] - 1 - k % 7));
    printf("| %s | %d | MUMPS sym=%d | %.2f | %.2f | %.3f | %.0f | error %.0e | analysis %.2f | info %d, ordering %d, delayed %d |\n", argv[1], n, sym,
           t2 - t0, t3 - t2, t4 - t3, (peak() - before) / 1e6, error, t1 - t0, id.infog[0], id.infog[6], id.infog[12]);
    id.job = -2, dmumps_c(&id);
    MPI_Finalize();
    return 0;
}
