/* Inverse dynamics along a motion that is known: Phi_q^T lambda = Q - M a by the LU of plain.c.
 *
 * equations.h has the function forces besides; its rates are followed by the second rates.
 */
#include "plain.c"

void run_forces(int count, const double *t, const double *p, const double *Q, const double *W,
                double *multipliers)
{
    for (int k = 0; k < count; k++) {
        double b[N], A[N * N];
        forces(Q + N * k, W + 2 * N * k, t[k], p, b, A);
        lu_solve(A, b);
        memcpy(multipliers + N * k, b, sizeof b);
    }
}
