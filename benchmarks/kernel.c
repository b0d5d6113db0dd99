/* The vector field of free flight in C, for one lane: what a compiler makes of the same
 * equations when nothing stands between them and the processor. Published gait, nodes and
 * polar; loops over nodes that the compiler vectorises, sums kept in registers, the integrals
 * along the body as running sums. See c_kernel.py. */

#include <math.h>

#define N 70
#define CELLS 6

typedef struct {
    double theta_m, psi_m, nu, rate, d_psi, d_theta, phase; /* rad, rad/s */
    double mass_total, gravity, density, viscosity, step;   /* step: m between nodes */
    double ramp[N], x[N], mass[N], share[N], chord[N], area[N];
    double cells[72 * CELLS * 8]; /* per cell: C_L and C_D, powers of beta and Re */
} Model;

typedef double Row[N];

/* Sine and cosine without a branch, so that loops with them are vectorised; 1e-16. */
static inline void sincos_(double x, double *sine, double *cosine)
{
    double n = rint(x * 0.6366197723675814);
    double r = x - n * 1.5707963267341256;
    r -= n * 6.077100506303966e-11;
    r -= n * 2.0222662487959506e-21;
    double z = r * r;
    double s = r + r * z * (-1.66666666666666324348e-01 + z * (8.33333333332248946124e-03
        + z * (-1.98412698298579493134e-04 + z * (2.75573137070700676789e-06
        + z * (-2.50507602534068634195e-08 + z * 1.58969099521155010221e-10)))));
    double c = 1 - 0.5 * z + z * z * (4.16666666666666019037e-02 + z * (-1.38888888888741095749e-03
        + z * (2.48015872894767294178e-05 + z * (-2.75573143513906633035e-07
        + z * (2.08757232129817482790e-09 + z * -1.13596475577881948265e-11)))));
    double q = n - 4 * floor(0.25 * n);
    int odd = q == 1 || q == 3;
    *sine = (odd ? c : s) * (q >= 2 ? -1 : 1);
    *cosine = (odd ? s : c) * (q == 1 || q == 2 ? -1 : 1);
}

/* Nine integrals along the body at once, by the trapezoid rule, less their mean by mass. */
static void integrate(const Row in[9], Row out[9], const Model *m)
{
    double sum[9], mean[9];
    for (int k = 0; k < 9; k++) {
        sum[k] = -0.5 * m->step * in[k][0];
    }
    for (int i = 0; i < N; i++) /* nine chains of additions side by side */
        for (int k = 0; k < 9; k++) {
            double half = 0.5 * m->step * in[k][i];
            out[k][i] = sum[k] + half;
            sum[k] = out[k][i] + half;
        }
    for (int k = 0; k < 9; k++) {
        double total = 0;
#pragma omp simd reduction(+ : total)
        for (int i = 0; i < N; i++) total += m->share[i] * out[k][i];
        mean[k] = total;
    }
    for (int k = 0; k < 9; k++)
#pragma omp simd
        for (int i = 0; i < N; i++) out[k][i] -= mean[k];
}

void vector_field(double time, const double *y, const Model *m, double *dy)
{
    Row f[9], p[9], sin_t, cos_t, sin_p, cos_p;
    const double a0 = m->phase + m->rate * time, w = m->rate, half = 1.5707963267948966;
#pragma omp simd
    for (int i = 0; i < N; i++) {
        double a = 6.283185307179586 * m->nu * m->x[i] + a0;
        double sin_a, cos_a, sin_u, cos_u, st, ct, sp, cp;
        sincos_(a, &sin_a, &cos_a);
        double u = half * cos_a, u1 = -half * sin_a * w, u2 = -u * w * w;
        sincos_(u, &sin_u, &cos_u);
        double tm = m->ramp[i] * m->theta_m, pm = m->ramp[i] * m->psi_m;
        double sin_2a = 2 * sin_a * cos_a, cos_2a = 2 * cos_a * cos_a - 1;
        double theta = tm * sin_u + m->ramp[i] * m->d_theta * m->x[i];
        double t1 = tm * cos_u * u1, t2 = tm * (cos_u * u2 - sin_u * u1 * u1);
        double psi = -pm * cos_2a + m->ramp[i] * m->d_psi * m->x[i];
        double p1 = 2 * pm * sin_2a * w, p2 = 4 * pm * cos_2a * w * w;
        sincos_(theta, &st, &ct);
        sincos_(psi, &sp, &cp);
        double flat1 = -sp * p1, flat2 = -cp * p1 * p1 - sp * p2;
        double turn = 2 * flat1 * t1 + cp * t2, shrink = flat2 - cp * t1 * t1;
        sin_t[i] = st; cos_t[i] = ct; sin_p[i] = sp; cos_p[i] = cp;
        f[0][i] = cp * st; f[1][i] = -cp * ct; f[2][i] = sp;
        f[3][i] = flat1 * st + cp * t1 * ct; f[4][i] = -flat1 * ct + cp * t1 * st;
        f[5][i] = cp * p1;
        f[6][i] = shrink * st + turn * ct; f[7][i] = -shrink * ct + turn * st;
        f[8][i] = cp * p2 - sp * p1 * p1;
    }
    integrate(f, p, m);

    const double sy = sin(y[9]), cy = cos(y[9]), sq = sin(y[10]), cq = cos(y[10]);
    const double sr = sin(y[11]), cr = cos(y[11]);
    const double R[3][3] = {
        {cr * cy - sr * sq * sy, cr * sy + sr * sq * cy, -sr * cq},
        {-cq * sy, cq * cy, sq},
        {sr * cy + cr * sq * sy, sr * sy - cr * sq * cy, cr * cq},
    };
    double v[3];
    for (int i = 0; i < 3; i++) v[i] = R[i][0] * y[3] + R[i][1] * y[4] + R[i][2] * y[5];
    const double wx = y[6], wy = y[7], wz = y[8];
    Row vx, vy, vz, v_c, v_b, speed, beta, re;
#pragma omp simd
    for (int i = 0; i < N; i++) {
        double x = p[0][i], yy = p[1][i], z = p[2][i];
        double ax = v[0] + p[3][i] + wy * z - wz * yy;
        double ay = v[1] + p[4][i] + wz * x - wx * z;
        double az = v[2] + p[5][i] + wx * yy - wy * x;
        double c = ax * cos_t[i] + ay * sin_t[i];
        double b = -ax * sin_p[i] * sin_t[i] + ay * sin_p[i] * cos_t[i] + az * cos_p[i];
        vx[i] = ax; vy[i] = ay; vz[i] = az; v_c[i] = c; v_b[i] = b;
        speed[i] = sqrt(c * c + b * b);
        beta[i] = atan2(-b, c);
        re[i] = sqrt(ax * ax + ay * ay + az * az) * m->chord[i] / m->viscosity;
    }
    double fx = 0, fy = 0, fz = 0, mx = 0, my = 0, mz = 0;
    double xx = 0, yy2 = 0, zz = 0, xy = 0, xz = 0, yz = 0;
#pragma omp simd reduction(+ : fx, fy, fz, mx, my, mz, xx, yy2, zz, xy, xz, yz)
    for (int i = 0; i < N; i++) {
        double s = beta[i] * (36 / 3.141592653589793) + 36;
        double r = (re[i] - 3000) / 2000;
        r = r < 0 ? 0 : r > CELLS ? CELLS : r;
        int row = (int)s, col = (int)r;
        row = row > 71 ? 71 : row < 0 ? 0 : row;
        col = col > CELLS - 1 ? CELLS - 1 : col;
        s -= row; r -= col;
        const double *q = m->cells + 8 * (row * CELLS + col);
        double lift = q[0] + r * q[1] + s * (q[2] + r * q[3]);
        double drag = q[4] + r * q[5] + s * (q[6] + r * q[7]);
        double k = 0.5 * m->density * speed[i] * m->area[i];
        double along_c = k * (-drag * v_c[i] - lift * v_b[i]);
        double along_b = k * (-drag * v_b[i] + lift * v_c[i]);
        double ex = along_c * cos_t[i] - along_b * sin_p[i] * sin_t[i];
        double ey = along_c * sin_t[i] + along_b * sin_p[i] * cos_t[i];
        double ez = along_b * cos_p[i];
        double x = p[0][i], y_ = p[1][i], z = p[2][i], mass = m->mass[i];
        double sx = wy * z - wz * y_, sy_ = wz * x - wx * z, sz = wx * y_ - wy * x;
        double hx = 2 * p[3][i] + sx, hy = 2 * p[4][i] + sy_, hz = 2 * p[5][i] + sz;
        double rx = p[6][i] + wy * hz - wz * hy;
        double ry = p[7][i] + wz * hx - wx * hz;
        double rz = p[8][i] + wx * hy - wy * hx;
        double gx = ex - mass * rx, gy = ey - mass * ry, gz = ez - mass * rz;
        fx += ex; fy += ey; fz += ez;
        mx += y_ * gz - z * gy; my += z * gx - x * gz; mz += x * gy - y_ * gx;
        xx += mass * x * x; yy2 += mass * y_ * y_; zz += mass * z * z;
        xy += mass * x * y_; xz += mass * x * z; yz += mass * y_ * z;
    }
    dy[0] = y[3]; dy[1] = y[4]; dy[2] = y[5];
    for (int i = 0; i < 3; i++)
        dy[3 + i] = (R[0][i] * fx + R[1][i] * fy + R[2][i] * fz) / m->mass_total;
    dy[5] -= m->gravity;
    double A = yy2 + zz, B = xx + zz, C = xx + yy2, D = -xy, E = -xz, F = -yz;
    double a11 = B * C - F * F, a12 = E * F - D * C, a13 = D * F - E * B;
    double a22 = A * C - E * E, a23 = D * E - A * F, a33 = A * B - D * D;
    double det = A * a11 + D * a12 + E * a13;
    dy[6] = (a11 * mx + a12 * my + a13 * mz) / det;
    dy[7] = (a12 * mx + a22 * my + a23 * mz) / det;
    dy[8] = (a13 * mx + a23 * my + a33 * mz) / det;
    dy[9] = (cr * wz - sr * wx) / cq;
    dy[10] = cr * wx + sr * wz;
    dy[11] = wy - sq * dy[9];
    dy[12] = sqrt(y[3] * y[3] + y[4] * y[4]);
}

/* `count` evaluations for each of `lanes` states, as a solver makes them. */
void evaluate(double *y, Model *models, int lanes, int count)
{
    for (int lane = 0; lane < lanes; lane++) {
        double dy[13], *state = y + 13 * lane;
        for (int i = 0; i < count; i++) {
            vector_field(1e-3 * i, state, models + lane, dy);
            for (int k = 0; k < 13; k++) state[k] += 1e-6 * dy[k];
        }
    }
}
