// The loop of filters/ekf.py once more, for comparison: one joint, states q, dq, tau_ext, a second-order step.
#include <cmath>

extern "C" void pass(const double *c, const double *inertia, const double *y_q, const double *y_dq, const double *drive,
                     long N, double T, const double *noise, double first_std, double first, double *out) {
  const double R_q = noise[0] * noise[0], R_dq = noise[1] * noise[1], walk = noise[4] * noise[4];
  const double Q_dd = noise[3] * noise[3], Q_qd = 0.5 * T * Q_dd;
  const double Q_qq = noise[2] * noise[2] + (0.5 * T * noise[3]) * (0.5 * T * noise[3]), h = 0.5 * T * T;
  double x1 = y_q[0], x2 = y_dq[0], x3 = 0;
  double a = first * R_q, b = 0, cc = 0, d = first * R_dq, e = 0, f = first_std * first_std;
  for (long k = 0; k < N; ++k) {
    const double i1 = y_q[k] - x1, i2 = y_dq[k] - x2;
    const double s11 = a + R_q, s12 = b, s22 = d + R_dq, det = s11 * s22 - s12 * s12;
    const double v11 = s22 / det, v12 = -s12 / det, v22 = s11 / det;
    const double k11 = a * v11 + b * v12, k12 = a * v12 + b * v22;
    const double k21 = b * v11 + d * v12, k22 = b * v12 + d * v22;
    const double k31 = cc * v11 + e * v12, k32 = cc * v12 + e * v22;
    out[6 * N + k] = i1 * (v11 * i1 + v12 * i2) + i2 * (v12 * i1 + v22 * i2);
    x1 += k11 * i1 + k12 * i2;
    x2 += k21 * i1 + k22 * i2;
    x3 += k31 * i1 + k32 * i2;
    const double m11 = 1 - k11, m12 = -k12, m21 = -k21, m22 = 1 - k22;
    const double p11 = m11 * a + m12 * b, p12 = m11 * b + m12 * d, p13 = m11 * cc + m12 * e;
    const double p21 = m21 * a + m22 * b, p22 = m21 * b + m22 * d, p23 = m21 * cc + m22 * e;
    const double p31 = cc - k31 * a - k32 * b, p32 = e - k31 * b - k32 * d, p33 = f - k31 * cc - k32 * e;
    a = p11 * m11 + p12 * m12 + k11 * R_q * k11 + k12 * R_dq * k12;
    b = p11 * m21 + p12 * m22 + k11 * R_q * k21 + k12 * R_dq * k22;
    d = p21 * m21 + p22 * m22 + k21 * R_q * k21 + k22 * R_dq * k22;
    cc = p13 - p11 * k31 - p12 * k32 + k11 * R_q * k31 + k12 * R_dq * k32;
    e = p23 - p21 * k31 - p22 * k32 + k21 * R_q * k31 + k22 * R_dq * k32;
    f = p33 - p31 * k31 - p32 * k32 + k31 * R_q * k31 + k32 * R_dq * k32;
    out[k] = x1;
    out[N + k] = x2;
    out[2 * N + k] = x3;
    out[3 * N + k] = std::sqrt(f);
    out[4 * N + k] = i1;
    out[5 * N + k] = i2;
    const double s = std::sin(x1), co = std::cos(x1), M = inertia[k];
    const double likely = std::erf(x2 / std::sqrt(2 * d + 1e-300)), left = T * c[5] / M;
    const double bias = c[0] + c[1] * s + c[2] * co + c[3] * x1 + c[4] * x2 + c[5] * likely;
    const double a_q = -(c[1] * co - c[2] * s + c[3]) / M, a_dq = -c[4] / M, a_tau = -1 / M;
    const double ddq = (drive[k] - bias - x3) / M, of_dq = T + h * a_dq;
    const double f11 = 1 + h * a_q, f13 = h * a_tau, f21 = of_dq * a_q, f22 = 1 + of_dq * a_dq + h * a_q;
    const double f23 = of_dq * a_tau, q = x1 + T * x2 + h * ddq;
    x2 = x2 + T * ddq + h * (a_q * x2 + a_dq * ddq);
    x1 = q;
    const double n11 = f11 * a + of_dq * b + f13 * cc, n12 = f11 * b + of_dq * d + f13 * e;
    const double n13 = f11 * cc + of_dq * e + f13 * f, n21 = f21 * a + f22 * b + f23 * cc;
    const double n22 = f21 * b + f22 * d + f23 * e, n23 = f21 * cc + f22 * e + f23 * f;
    a = n11 * f11 + n12 * of_dq + n13 * f13 + Q_qq;
    b = n21 * f11 + n22 * of_dq + n23 * f13 + Q_qd;
    d = n21 * f21 + n22 * f22 + n23 * f23 + Q_dd + left * left * (1 - likely * likely);
    cc = n13;
    e = n23;
    f = f + walk;
  }
}
