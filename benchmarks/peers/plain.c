/* A straightforward program: Newton from point to point, dense LU with partial pivoting.
 *
 * equations.h defines N, K and the three functions position, velocity and acceleration, printed by
 * SymPy after cse: of a position Phi and Phi_q, of the others Phi_q and the right-hand side.
 */
#include <math.h>
#include <string.h>
#include "equations.h"

#define MAX_ITERATIONS 25
#define TOLERANCE 1e-10

static void lu_solve(double *A, double *b)
{
    for (int k = 0; k < N; k++) {
        int pivot = k;
        for (int i = k + 1; i < N; i++)
            if (fabs(A[i * N + k]) > fabs(A[pivot * N + k]))
                pivot = i;
        if (pivot != k) {
            for (int j = k; j < N; j++) {
                double x = A[k * N + j];
                A[k * N + j] = A[pivot * N + j];
                A[pivot * N + j] = x;
            }
            double x = b[k];
            b[k] = b[pivot];
            b[pivot] = x;
        }
        double inverse = 1 / A[k * N + k];
        for (int i = k + 1; i < N; i++) {
            double factor = A[i * N + k] * inverse;
            if (factor != 0) {
                for (int j = k + 1; j < N; j++)
                    A[i * N + j] -= factor * A[k * N + j];
                b[i] -= factor * b[k];
            }
        }
    }
    for (int i = N - 1; i >= 0; i--) {
        double x = b[i];
        for (int j = i + 1; j < N; j++)
            x -= A[i * N + j] * b[j];
        b[i] = x / A[i * N + i];
    }
}

/* One point: q is where Newton starts and becomes the position; returns 0 if it converged. */
static int solve_point(double *q, double *w, double *a, double t, const double *p)
{
    double b[N], A[N * N];
    int iteration = 0;
    for (; iteration < MAX_ITERATIONS; iteration++) {
        double square = 0;
        position(q, w, t, p, b, A);
        lu_solve(A, b);
        for (int i = 0; i < N; i++) {
            q[i] -= b[i];
            square += b[i] * b[i];
        }
        if (sqrt(square) < TOLERANCE)
            break;
    }
    velocity(q, w, t, p, w, A);
    lu_solve(A, w);
    acceleration(q, w, t, p, a, A);
    lu_solve(A, a);
    return iteration == MAX_ITERATIONS;
}

/* A whole analysis; with is_predicted, Newton starts from q + h w + h^2 a / 2. */
int run(int count, const double *t, const double *p, const double *guess, int is_predicted,
        double *Q, double *W, double *A)
{
    double q[N], w[N] = {0}, a[N] = {0};
    int failed = 0;
    memcpy(q, guess, sizeof q);
    for (int k = 0; k < count; k++) {
        double h = is_predicted && k ? t[k] - t[k - 1] : 0;
        for (int i = 0; i < N; i++)
            q[i] += h * (w[i] + h / 2 * a[i]);
        failed += solve_point(q, w, a, t[k], p);
        memcpy(Q + N * k, q, sizeof q);
        memcpy(W + N * k, w, sizeof w);
        memcpy(A + N * k, a, sizeof a);
    }
    return failed;
}

/* Many parameter sets, one after the other. */
int run_variants(int variants, int count, const double *t, const double *p, const double *guess,
                 int is_predicted, double *Q, double *W, double *A)
{
    int failed = 0;
    for (int v = 0; v < variants; v++) {
        size_t offset = (size_t)v * count * N;
        failed += run(count, t, p + K * v, guess, is_predicted, Q + offset, W + offset, A + offset);
    }
    return failed;
}
