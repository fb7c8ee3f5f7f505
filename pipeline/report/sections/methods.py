"""How the numbers were made, with the equations."""

from collections.abc import Iterator

from pipeline.records import Fit
from pipeline.report.content import Block, Equation, Prose, Section
from pipeline.report.context import Context


def section(context: Context) -> Section:
    """Prose and equations, in the order of the stages."""
    return Section("Methods", "methods", tuple(blocks(context)))


def blocks(context: Context) -> Iterator[Block]:
    """The section's content."""
    settings = context.study.settings
    yield Prose(
        "**From the motor to the joint.** Logs of the motor side are carried to the joint through the gear ratio "
        "$eta$ and the torque constant $K_m$; logs of the joint side are used as they are."
    )
    yield Equation(
        "q = theta_m / eta, quad tau = eta K_m i",
        "joint position is motor angle over gear ratio; effort is gear ratio times torque constant times current",
        "motor",
    )
    yield Prose(
        "**Periods.** The period is the shortest lag after which all moving joints repeat, refined until the "
        "harmonics of the excitation fit the positions best. A sample rarely falls on a phase of the averaged period "
        "exactly: a smooth harmonic fit carries it there, and what the fit leaves is averaged over the $M$ periods. "
        "The variance between periods is that of one period; the mean's is smaller by $M$."
    )
    yield Equation(
        "overline(x)(k) = 1/M sum_(m=1)^M x_m (k), "
        "quad sigma_x^2 (k) = 1/(M-1) sum_(m=1)^M (x_m (k) - overline(x)(k))^2",
        "the mean over periods, and the variance between them",
        "averaging",
    )
    how = "projection on the harmonics" if settings.derivative == "harmonics" else "the fast Fourier transform"
    yield Prose(
        f"**Differentiation.** Only the harmonics of the excitation are kept of the averaged position, by {how}, and "
        "differentiated exactly."
    )
    yield Equation(
        "cal(F)[(dif^n overline(q)) / (dif t^n)] = (j omega)^n Q(omega)",
        "the spectrum of the n-th derivative is j omega to the n times that of the position",
        "differentiation",
    )
    yield Prose(
        f"Motion that does not repeat is low-passed forwards and backwards at {settings.lowpass:g} Hz "
        "(fourth-order Butterworth, no delay), and differentiated by central differences."
    )
    yield Prose(
        "**Identification.** The model of each joint is linear in its parameters. Least squares gives every averaged "
        "sample the same weight; weighted least squares gives it the inverse of its variance, pooled over "
        "neighbouring samples because the variance between few periods is itself uncertain. Both are solved by "
        "orthogonal factorisation, never by the normal equations."
    )
    yield Equation(
        "hat(theta) = arg min_theta norm(W^(1/2) (tau - Phi(q, dot(q), dot.double(q)) theta))^2",
        "the parameters minimise the weighted sum of squared differences between effort and regressor times parameters",
        "estimation",
    )
    if any(fit.estimator == "wlse" for fit in context.catalogue.all(Fit)):
        yield Prose('The weights are $W = "diag"(M \\/ sigma_tau^2)$; with fewer than four periods they are left out.')
    yield Prose(
        "**Filtering.** The state holds position, velocity and external effort, the last as a random walk. Each "
        "sample is first corrected with its measurement and then carried to the next; the covariance is corrected in "
        "Joseph's form. The external effort is what the robot exerts on its environment: a mass hung on a vertical "
        "slide gives a negative one."
    )
    yield Equation(
        "q_(k+1) &= q_k + T_s dot(q)_k \\ "
        'dot(q)_(k+1) &= dot(q)_k + T_s M^(-1) (tau_k - V - F - G - tau_("ext",k)) + w_k \\ '
        'tau_("ext",k+1) &= tau_("ext",k) + w_(tau,k)',
        "the discrete model of position, velocity and external effort",
        "model",
    )
    yield Equation(
        "tilde(y)_k = y_k - H hat(x)_(k|k-1), quad S_k = H P_(k|k-1) H^T + R, quad K_k = P_(k|k-1) H^T S_k^(-1)",
        "innovation, its covariance, and the Kalman gain",
        "innovation",
    )
    yield Equation(
        "hat(x)_(k|k) = hat(x)_(k|k-1) + K_k tilde(y)_k, "
        "quad P_(k|k) = (I - K_k H) P_(k|k-1) (I - K_k H)^T + K_k R K_k^T",
        "the corrected state and covariance",
        "correction",
    )
    yield Prose(
        "Forward Euler leaves out $1/2 T_s^2$ times the next derivative in each step, which counts as process noise. "
        "The measured effort drives the model, so its noise $sigma_tau$ is process noise of the velocity, with "
        "standard deviation $T_s sigma_tau \\/ M$. **Whiteness** is judged by the autocorrelation, its 95 % band "
        "$1.96 \\/ sqrt(N)$, and the Ljung-Box statistic over 20 lags; a signal is called white when its probability "
        "exceeds 1 %."
    )
