// Loops as functions, by hand: what a controls engineer writes, closed forms or small Newton.
// Each peer takes inputs u to outputs x and their Jacobian J, and keeps its own last position.
#include <math.h>
#include <string.h>

#define APART __attribute__((noinline))

// Crank-rocker: the circles of coupler and rocker meet; C left of the line from B to D.
APART void peer_crank_rocker(const double *u, double *x, double *J)
{
    const double a = 0.04, b = 0.12, c = 0.08, d = 0.13;
    const double bx = a * cos(u[0]), by = a * sin(u[0]), ex = d - bx, ey = -by;
    const double r2 = ex * ex + ey * ey, k = (b * b - c * c + r2) / (2 * r2);
    const double h = sqrt(b * b / r2 - k * k);
    const double cx = bx + k * ex - h * ey, cy = by + k * ey + h * ex;
    const double ux = cx - bx, uy = cy - by, vx = cx - d, vy = cy;
    x[0] = atan2(vy, vx);
    J[0] = (uy * bx - ux * by) / (uy * vx - ux * vy);
}

// Ankle on two actuators: Newton in pitch and roll, R = Ry(pitch) Rx(roll).
APART void peer_ankle(const double *u, double *x, double *J)
{
    static const double A[2][3] = {{-0.045, 0.036, 0.24}, {-0.045, -0.036, 0.24}};
    static const double B[2][3] = {{-0.052, 0.034, 0.015}, {-0.052, -0.034, 0.015}};
    static double pitch, roll;
    double M[2][2], f[2], det = 0;
    for (int it = 0; it < 20; it++) {
        const double cp = cos(pitch), sp = sin(pitch), cr = cos(roll), sr = sin(roll);
        for (int i = 0; i < 2; i++) {
            const double y = B[i][1] * cr - B[i][2] * sr, z = B[i][1] * sr + B[i][2] * cr;
            const double px = cp * B[i][0] + sp * z, pz = cp * z - sp * B[i][0];
            const double dx = px - A[i][0], dy = y - A[i][1], dz = pz - A[i][2];
            const double l = sqrt(dx * dx + dy * dy + dz * dz);
            f[i] = l - u[i];
            M[i][0] = (dx * pz - dz * px) / l;
            M[i][1] = (dx * sp * y - dy * z + dz * cp * y) / l;
        }
        det = M[0][0] * M[1][1] - M[0][1] * M[1][0];
        const double dp = (M[1][1] * f[0] - M[0][1] * f[1]) / det;
        const double dr = (M[0][0] * f[1] - M[1][0] * f[0]) / det;
        pitch -= dp;
        roll -= dr;
        if (fabs(dp) + fabs(dr) < 1e-10)
            break;
    }
    x[0] = pitch;
    x[1] = roll;
    J[0] = M[1][1] / det;
    J[1] = -M[0][1] / det;
    J[2] = -M[1][0] / det;
    J[3] = M[0][0] / det;
}

// Delta: three spheres about the shifted elbows meet below; J from the rods' directions.
APART void peer_delta(const double *u, double *x, double *J)
{
    const double base = 0.2, arm = 0.25, rod = 0.5, top = 0.05;
    double E[3][3], T[3][3], w[3], n[3][3];
    for (int k = 0; k < 3; k++) {
        const double c = k == 0 ? 1.0 : -0.5, s = k == 0 ? 0.0 : k == 1 ? sqrt(0.75) : -sqrt(0.75);
        const double r = base - top + arm * cos(u[k]);
        E[k][0] = r * c;
        E[k][1] = r * s;
        E[k][2] = -arm * sin(u[k]);
        T[k][0] = -arm * sin(u[k]) * c;
        T[k][1] = -arm * sin(u[k]) * s;
        T[k][2] = -arm * cos(u[k]);
    }
    // planes of equal distance: (E_k - E_0) . P = w_k; then P = p + z d
    double a[2][3];
    for (int k = 0; k < 3; k++)
        w[k] = E[k][0] * E[k][0] + E[k][1] * E[k][1] + E[k][2] * E[k][2];
    for (int k = 0; k < 2; k++)
        for (int j = 0; j < 3; j++)
            a[k][j] = E[k + 1][j] - E[0][j];
    const double g0 = (w[1] - w[0]) / 2, g1 = (w[2] - w[0]) / 2;
    const double det = a[0][0] * a[1][1] - a[0][1] * a[1][0];
    const double px = (g0 * a[1][1] - a[0][1] * g1) / det, py = (a[0][0] * g1 - g0 * a[1][0]) / det;
    const double dx = (a[0][1] * a[1][2] - a[0][2] * a[1][1]) / det;
    const double dy = (a[0][2] * a[1][0] - a[0][0] * a[1][2]) / det;
    const double qx = px - E[0][0], qy = py - E[0][1], qz = -E[0][2];
    const double A = dx * dx + dy * dy + 1, H = qx * dx + qy * dy + qz;
    const double C = qx * qx + qy * qy + qz * qz - rod * rod;
    const double z = (-H - sqrt(H * H - A * C)) / A;
    x[0] = px + z * dx;
    x[1] = py + z * dy;
    x[2] = z;
    for (int k = 0; k < 3; k++) {
        for (int j = 0; j < 3; j++)
            n[k][j] = x[j] - E[k][j];
        w[k] = n[k][0] * T[k][0] + n[k][1] * T[k][1] + n[k][2] * T[k][2];
    }
    // n_k . dx = w_k du_k: J is the inverse of the rows n, times w
    double I[3][3], whole = 0;
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            I[j][i] = n[(i + 1) % 3][(j + 1) % 3] * n[(i + 2) % 3][(j + 2) % 3]
                - n[(i + 1) % 3][(j + 2) % 3] * n[(i + 2) % 3][(j + 1) % 3];
    for (int j = 0; j < 3; j++)
        whole += n[0][j] * I[j][0];
    for (int i = 0; i < 3; i++)
        for (int k = 0; k < 3; k++)
            J[3 * i + k] = I[i][k] * w[k] / whole;
}
