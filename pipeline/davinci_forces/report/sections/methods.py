"""The methods behind the numbers, with their equations."""

from collections.abc import Iterator

from davinci_forces.records import Average, Fit, LogSummary, Record, Signal, Track, Trajectory, Whiteness
from davinci_forces.records.prediction import CHOSEN
from davinci_forces.report.content import Block, Bullets, Equation, Listing, Prose, Section, Table
from davinci_forces.report.context import Context
from davinci_forces.report.verdicts import thresholds

SYMBOLS = (
    ("$q, dot(q), dot.double(q)$", "position, velocity and acceleration of a joint", "rad or m"),
    ("$tau$", "effort of a joint: torque where it turns, force where it slides", "N m or N"),
    ('$tau_"ext"$', "external effort: what the robot exerts on its environment, joint by joint", "N m or N"),
    ("$theta, hat(theta)$", "parameters of a joint's model, and their estimates", "as listed"),
    ("$Phi$", "regressor: effort is $Phi theta$", ""),
    ("$M, V, F, G$", "inertia, velocity terms, friction and gravity", ""),
    ("$W$", "weights of weighted least squares", ""),
    ("$i, K_m, eta$", "motor current, torque constant and gear ratio", "A, N m/A, –"),
    ("$theta_m$", "motor angle", "rad"),
    ("$N_p$", "number of periods that are averaged", ""),
    ("$sigma$", "standard deviation of the noise of the signal in the subscript", ""),
    ("$T_s$", "sampling time", "s"),
    ("$x, y, hat(x), tilde(y)$", "state and measurement of the filter, estimated state, innovation", ""),
    ("$P, R, S, K$", "covariance of the state, of the measurement noise and of the innovation; Kalman gain", ""),
    ("$w$", "process noise", ""),
)
REFERENCES = (
    "Force Feedback in the da Vinci Surgical Robot. Master's thesis, Aalborg University: the models, the "
    "identification and the filter that this analysis starts from.",
    "Y. Wang, R. Gondokaryono, A. Munawar, G. S. Fischer: A convex optimization-based dynamic model identification "
    "package for the da Vinci Research Kit. IEEE Robotics and Automation Letters 4 (4), 2019.",
    "H. D. Patterson, R. Thompson: Recovery of inter-block information when block sizes are unequal. Biometrika 58 "
    "(3), 1971.",
    "H. White: A heteroskedasticity-consistent covariance matrix estimator and a direct test for heteroskedasticity. "
    "Econometrica 48 (4), 1980.",
    "G. M. Ljung, G. E. P. Box: On a measure of lack of fit in time series models. Biometrika 65 (2), 1978.",
    "C. M. Jarque, A. K. Bera: A test for normality of observations and regression residuals. International "
    "Statistical Review 55 (2), 1987.",
    "H. R. Künsch: The jackknife and the bootstrap for general stationary observations. The Annals of Statistics "
    "17 (3), 1989.",
    "Y. Bar-Shalom, X. R. Li, T. Kirubarajan: Estimation with Applications to Tracking and Navigation. Wiley, 2001.",
    "G. J. Bierman: Fixed interval smoothing with discrete measurements. International Journal of Control 18 (1), "
    "1973.",
    "S. O. Rice: Mathematical analysis of random noise. Bell System Technical Journal 23 (3), 1944.",
    "M. S. Bartlett: An Introduction to Stochastic Processes. Cambridge University Press, 1955.",
    "A. De Luca, R. Mattone: Actuator failure detection and isolation using generalized momenta. IEEE International "
    "Conference on Robotics and Automation, 2003.",
)
# The method of each stage, by the records that it makes; the settings of the study replace the braces.
METHODS: tuple[tuple[type[Record], tuple[Block, ...]], ...] = (
    (LogSummary, (
        Prose(
            "**From the motor to the joint.** Logs of the motor side are carried to the joint through the gear ratio "
            "$eta$ and the torque constant $K_m$; logs of the joint side are used unchanged.{in_current}"
        ),
        Equation(
            "q = theta_m / eta, quad tau = eta K_m i",
            "joint position is motor angle over gear ratio; effort is gear ratio times torque constant times current",
            "motor",
        ),
    )),
    (Average, (
        Prose(
            "**Periods.** The period is the shortest lag after which all moving joints repeat their motion. It is "
            "refined until the harmonics of the excitation fit the positions best. Samples rarely fall on the phases "
            "of the averaged period. A harmonic series is fitted to all samples and evaluated at these phases. The "
            "mean residual of the samples nearest to a phase is added there, to keep motion beyond the harmonics. "
            "$sigma_x^2$ is the variance of a sample of one period; the variance of the mean is $N_p$ times smaller."
        ),
        Equation(
            "overline(x)(k) = 1/N_p sum_(m=1)^(N_p) x_m (k), "
            "quad sigma_x^2 (k) = 1/(N_p - 1) sum_(m=1)^(N_p) (x_m (k) - overline(x)(k))^2",
            "the mean over periods, and the variance between them",
            "averaging",
        ),
    )),
    (Trajectory, (
        Prose(
            "**Differentiation.** The averaged position is projected on the harmonics of the excitation, which are "
            "differentiated exactly."
        ),
        Equation(
            "cal(F)[(dif^n overline(q)) / (dif t^n)] = (j omega)^n Q(omega)",
            "the spectrum of the n-th derivative is j omega to the n times that of the position",
            "differentiation",
        ),
    )),
    (Signal, (
        Prose(
            "Motion that does not repeat is low-passed forwards and backwards at {lowpass} Hz (fourth-order "
            "Butterworth, no delay), and differentiated by central differences."
        ),
    )),
    (Fit, (
        Prose(
            "**Identification.** The model of each joint is linear in its parameters. Least squares gives every "
            "averaged sample the same weight. Weighted least squares gives it the inverse of its variance, pooled over "
            "neighbouring samples because the variance between few periods is itself uncertain. Both are solved by "
            "orthogonal factorisation, never by the normal equations. Consistent parameters are the physically "
            "possible parameters that are nearest to least squares."
        ),
        Equation(
            "hat(theta) = arg min_theta norm(W^(1/2) (tau - Phi(q, dot(q), dot.double(q)) theta))^2",
            "the parameters minimise the weighted sum of squared differences between effort and regressor times "
            "parameters",
            "estimation",
        ),
        Prose('The weights are $W = "diag"(N_p \\/ sigma_tau^2)$. Below four periods they are not used.'),
    )),
    (Track, (
        Prose(
            "**Filtering.** The state holds position, velocity and external effort, the last as a random walk. At each "
            "sample the state is corrected with the measurement, and then predicted to the next sample. The covariance "
            "is corrected in Joseph's form. The external effort is what the robot exerts on its environment: a mass "
            "attached to a vertical slide gives a negative external effort."
        ),
        Equation(
            'f(x, tau) = [dot(q), M^(-1) (tau - V - F - G - tau_"ext"), 0]^T, quad A = (partial f) / (partial x), quad '
            "x_(k+1) = x_k + T_s f + 1/2 T_s^2 A f + w_k",
            "the discrete model of position, velocity and external effort, to second order",
            "model",
        ),
        Equation(
            "tilde(y)_k = y_k - H hat(x)_(k|k-1), quad S_k = H P_(k|k-1) H^T + R, quad K_k = P_(k|k-1) H^T S_k^(-1)",
            "innovation, its covariance, and the Kalman gain",
            "innovation",
        ),
        Equation(
            "hat(x)_(k|k) = hat(x)_(k|k-1) + K_k tilde(y)_k, "
            "quad P_(k|k) = (I - K_k H) P_(k|k-1) (I - K_k H)^T + K_k R K_k^T",
            "the corrected state and covariance",
            "correction",
        ),
        Prose(
            "The measured effort is the input of the model, so its noise is process noise: it acts as an error of the "
            "acceleration that is constant over a sample. Near zero velocity, Coulomb friction is replaced by its "
            "expected value given the uncertain velocity, and the uncertainty of its sign is added to the noise. A "
            "contact is found if the smoothed effort (Bierman, 1973) exceeds the level that free motion crosses once "
            "in ten minutes (Rice, 1944)."
        ),
    )),
    (Whiteness, (
        Prose(
            "**Whiteness** is tested by the autocorrelation, its 95 % band $1.96 \\/ sqrt(N)$, and the Ljung-Box "
            "statistic over 20 lags. A signal is called white if its p-value exceeds 1 %. The cumulative "
            "periodograms of innovations must pass, too, by their Kolmogorov-Smirnov distance from a straight line "
            "(Bartlett, 1955)."
        ),
    )),
)  # fmt: skip


def section(context: Context) -> Section:
    """Prose and equations in the order of the stages; symbols, thresholds, a paragraph for a paper, and references."""
    symbols = Table(
        "Symbols.", ("Symbol", "Is", "Unit"), tuple((s, m, u or "–") for s, m, u in SYMBOLS), "symbols", "lll"
    )
    limits = Table(
        "The thresholds of all verdicts of this report.",
        ("Quantity", "Measure", "Good", "Caution", "Problem"), thresholds(), "thresholds", "lllll",
    )  # fmt: skip
    paragraph = Section("A paragraph for a paper", "paragraph", (Listing(paragraph_for_paper(context)),))
    references = Section("References", "references", (Bullets(REFERENCES),))
    return Section("Methods", "methods", (*blocks(context), limits, symbols, paragraph, references))


def paragraph_for_paper(context: Context) -> str:
    """A paragraph on the method with this study's numbers, for a paper."""
    settings, robot = context.study.settings, context.study.robot
    fits = context.own_fits()
    joints = ", ".join(dict.fromkeys(fit.group.replace("_", " ") for fit in fits)) or "no joint"
    logs = sorted({log for fit in fits for log in fit.logs})
    follows = "the smallest with which the filter returns 90 % of the peak of a push of 1 s within 0.1 s"
    random_walk = f"{settings.q_tau:g} (effort/s^0.5)" if settings.q_tau else follows
    model = "selected by cross-validation over blocks of path" if settings.fit == CHOSEN else settings.fit
    return (
        f"External efforts of the {robot.title} ({joints}) were estimated from motor efforts and joint positions with "
        f"davinci-forces {context.provenance.version}. Dynamic parameters were identified from {len(logs)} periodic "
        f"excitation recording{'' if len(logs) == 1 else 's'} ({', '.join(logs)}), averaged over periods and "
        f"differentiated in the frequency domain; the model was {model}. Motion that does not repeat was low-pass "
        f"filtered at {settings.lowpass:g} Hz with zero phase. The external effort was tracked by an extended Kalman "
        "filter with position, velocity and external effort as states, the last as a random walk. Its intensity was "
        f"{random_walk}. Standard errors allow for autocorrelated residuals, by restricted likelihood (Patterson and "
        "Thompson, 1971); levels of free motion were bootstrapped over blocks (Künsch, 1989)."
    )


def in_current(context: Context) -> str:
    """State the joints whose effort is a current, because no torque constant is known."""
    joints = [joint.title.lower() for joint in context.study.robot.joints if joint.effort]
    if not joints:
        return ""
    return (
        f" No torque constant of the {', '.join(joints)} is known. Their effort is the motor's current in A, and so "
        "are their external effort and levels."
    )


def blocks(context: Context) -> Iterator[Block]:
    """The method of each stage that made records, in the order of the stages."""
    settings = context.study.settings
    words = {"lowpass": f"{settings.lowpass:g}", "in_current": in_current(context)}
    for kind, method in METHODS:
        if context.catalogue.records(kind):
            yield from (Prose(block.text.format(**words)) if isinstance(block, Prose) else block for block in method)
