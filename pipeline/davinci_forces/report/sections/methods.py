"""The methods behind the numbers, with their equations."""

import re
from collections.abc import Iterator
from pathlib import Path
from textwrap import fill

from davinci_forces import records
from davinci_forces.files import read_bytes, text_of
from davinci_forces.records.prediction import CHOSEN
from davinci_forces.report.content import Block, Bullets, Equation, Listing, Prose, Section, Table
from davinci_forces.report.context import Context, count
from davinci_forces.report.sections.parts import of_joint, section_of, trust
from davinci_forces.report.verdicts import percent, thresholds

SYMBOLS = (
    ("$q, dot(q), dot.double(q)$", "position, velocity and acceleration of a joint", "rad or m"),
    ("$tau$", "effort of a joint: torque where it turns, force where it slides", "N m or N"),
    ('$tau_"ext"$', "external effort: what the robot exerts on its environment, joint by joint", "N m or N"),
    ("$theta, hat(theta)$", "parameters of a joint's model, and their estimates", "as listed"),
    ("$Phi$", "regressor: effort is $Phi theta$", "–"),
    ("$M, V, F, G$", "inertia, velocity terms, friction and gravity", "–"),
    ("$W$", "weights of weighted least squares", "–"),
    ("$i, K_m, eta$", "motor current, torque constant and gear ratio", "A, N m/A, –"),
    ("$theta_m$", "motor angle", "rad"),
    ("$beta_j, Y_j$", "parameters of the links, and their columns of the regressor", "as listed"),
    ("$z_1, z_2, z_3$", "states of presliding friction, from −1 to 1 (in tables, $z$ is a value over its error)", "–"),
    ("$N, N_p$", "number of samples; number of periods that are averaged", "–"),
    ("$sigma$", "standard deviation of the noise of the signal in the subscript", "–"),
    ("$T_s$", "sampling time", "s"),
    ("$x, y, hat(x), tilde(y)$", "state and measurement of the filter, estimated state, innovation", "–"),
    ("$P, R, S, K$", "covariance of the state, of the measurement noise and of the innovation; Kalman gain", "–"),
    ("$w$", "process noise", "–"),
    ("$f, A, H, I$", "the filter's model, its Jacobian, the matrix of measured states, the identity", "–"),
    ("$k, m, n, r$", "number of a sample, of a period, order of a derivative, number of a joint", "–"),
    ("$omega, j, Q$", "angular frequency, imaginary unit, spectrum of the averaged position", "rad/s"),
    ("$E, g$", "relative error of a candidate; a part of the data that is left out", "–"),
    ("$e, s_e$", "smoothed external effort in free motion outside the fit; its deviation by the smoother", "N m or N"),
    ("$s, kappa, v$", "stated deviation of the external effort; its factor; variance of the model's error", "N m or N"),
    ("$cal(l), z_0$", "alarm level; upward crossings of zero by $e$", "N m or N, 1/s"),
    ("$m_L, c_r, epsilon_r$", "mass; effort per kilogram and model error (root mean square) of joint $r$", "kg"),
    ("$F_T, F_0, d, K_T, B, nu$", "force on tissue; its offset; depth; stiffness; damping; exponent", "N, m, N/m"),
)
BIBLIOGRAPHY = Path(__file__).with_name("references.bib")
ENTRY, FIELD = re.compile(r"@\w+\{.*?^\}", re.M | re.S), re.compile(r"^  (\w+) = \{(.*)\},$", re.M)
# The method of each stage, by the records that it makes; the settings of the study replace the braces.
METHODS: tuple[tuple[type[records.Record], tuple[Block, ...]], ...] = (
    (records.LogSummary, (
        Prose("**From the motor to the joint.** Logs of the motor side are carried to the joint through the gear "
              "ratio $eta$ and the torque constant $K_m$; logs of the joint side are used unchanged."),
        Equation("q = theta_m / eta, quad tau = eta K_m i",
                 "joint position is motor angle over gear ratio; effort is gear ratio times torque constant times "
                 "current", "motor"),
    )),
    (records.Average, (
        Prose("**Periods.** The period is the shortest lag after which all moving joints repeat their motion. It is "
              "refined until the harmonics of the excitation fit the positions best. Samples rarely fall on the "
              "phases of the averaged period. A harmonic series is fitted to all samples and evaluated at these "
              "phases. The mean residual of the samples nearest to a phase is added there, to keep motion beyond "
              "the harmonics. $sigma_x^2$ is the variance of a sample of one period; the variance of the mean is "
              "$N_p$ times smaller."),
        Equation("overline(x)(k) = 1/N_p sum_(m=1)^(N_p) x_m (k), quad sigma_x^2 (k) = 1/(N_p - 1) sum_(m=1)^(N_p) "
                 "(x_m (k) - overline(x)(k))^2",
                 "the mean over periods, and the variance between them", "averaging"),
    )),
    (records.Trajectory, (
        Prose("**Differentiation.** The averaged position is projected on its harmonics, which are "
              "differentiated exactly."),
        Equation("cal(F)[(dif^n overline(q)) / (dif t^n)] = (j omega)^n Q(omega)",
                 "the spectrum of the n-th derivative is j omega to the n times that of the position",
                 "differentiation"),
    )),
    (records.Signal, (
        Prose("Motion that does not repeat is low-passed forwards and backwards at {lowpass} Hz (fourth-order "
              "Butterworth, no delay), and differentiated by central differences."),
    )),
    (records.Fit, (
        Prose("**Identification.** The model of each joint is linear in its parameters. Least squares gives every "
              "averaged sample the same weight. Weighted least squares gives it the inverse of its variance, pooled "
              "over neighbouring samples because the variance between few periods is itself uncertain. Both are "
              "solved by orthogonal factorisation, never by the normal equations. Consistent parameters are the "
              "physically possible parameters that are nearest to least squares."),
        Equation("hat(theta) = arg min_theta norm(W^(1/2) (tau - Phi(q, dot(q), dot.double(q)) theta))^2",
                 "the parameters minimise the weighted sum of squared differences between effort and regressor "
                 "times parameters", "estimation"),
        Prose('The weights are $W = "diag"(N_p \\/ sigma_tau^2)$. Below four periods they are not used.'),
    )),
    (records.Choice, (
        Prose("**Choice of the model.** [@choice] says which parts are left out. A candidate is “clearly "
              "worse” by more than one standard error of the difference, by the jackknife over parts (Efron, 1982)."),
        Equation("E = overline(sqrt(sum_g norm(tau_g - Phi_g hat(theta)_(-g))^2)) / norm(tau)",
                 "the relative error, mean over ways to leave out parts, by parameters without them", "choice-error"),
    )),
    (records.Track, (
        Prose("**Filtering.** The state holds position, velocity and external effort, the last as a random walk. At "
              "each sample the state is corrected with the measurement, and then predicted to the next sample. The "
              "covariance is corrected in Joseph's form. A mass attached to a vertical slide gives a negative external "
              "effort, as the robot exerts it."),
        Equation('f(x, tau) = [dot(q), M^(-1) (tau - V - F - G - tau_"ext"), 0]^T, quad A = (partial f) / (partial '
                 "x), quad x_(k+1) = x_k + T_s f + 1/2 T_s^2 A f + w_k",
                 "the discrete model of position, velocity and external effort, to second order", "model"),
        Equation("tilde(y)_k = y_k - H hat(x)_(k|k-1), quad S_k = H P_(k|k-1) H^T + R, quad K_k = P_(k|k-1) H^T "
                 "S_k^(-1)",
                 "innovation, its covariance, and the Kalman gain", "innovation"),
        Equation("hat(x)_(k|k) = hat(x)_(k|k-1) + K_k tilde(y)_k, quad P_(k|k) = (I - K_k H) P_(k|k-1) (I - K_k "
                 "H)^T + K_k R K_k^T",
                 "the corrected state and covariance", "correction"),
        Prose("The measured effort is the input of the model, so its noise is process noise: it acts as an error of "
              "the acceleration that is constant over a sample. Near zero velocity, Coulomb friction is replaced by "
              "its expected value given the uncertain velocity, and the uncertainty of its sign is added to the "
              "noise."),
    )),
    (records.ErrorBand, (
        Prose("**Band.** The smoother's deviation does not include the model's error. Free motion of other logs, which "
              "were not fitted, shows this error: for each range of speed, the stated deviation $s$ is scaled so that "
              "$1.96 s$ covers 95 % of it. If there are few logs, the factor is larger."),
        Equation('v = max(overline(e^2 - s_e^2), 0), quad kappa = 1/1.96 op("quantile")_95 abs(e) / sqrt(s_e^2 + '
                 "v), quad s = kappa sqrt(s_e^2 + v)",
                 "the model's variance, the factor from the 95 % quantile of normalised errors, and the stated "
                 "deviation", "band"),
    )),
    (records.Threshold, (
        Prose("**Detection.** The alarm level of the smoothed effort (Bierman, 1973) is the larger of two: the largest "
              "effort in free motion, and the level that free motion like that of the logs crosses once in ten minutes "
              "(Rice, 1944). The detection level of the tables is the 99 % quantile of $abs(e)$."),
        Equation("cal(l) = max(max abs(e), sqrt(overline(e^2)) sqrt(2 ln(600 z_0)))",
                 "the alarm level: root mean square times the root of twice the logarithm of 600 s times the "
                 "crossing rate", "detection"),
    )),
    (records.Weight, (
        Prose("**Weighing.** An offset of the day, where the data can separate it from the load, is removed by "
              "subtracting the means over the run on both sides. The error of the mass is widened as by Birge (1932)."),
        Equation('hat(m)_L = (sum_r c_r^T tau_("ext",r) \\/ epsilon_r^2) / (sum_r c_r^T c_r \\/ epsilon_r^2)',
                 "the mass: efforts per kilogram times external efforts, over their squares, weighted by the model "
                 "error", "weighing"),
    )),
    (records.TorqueConstant, (
        Prose("**Torque constant.** The constant in use is scaled until the joint alone gives the known mass. The "
              "variance of the result is the mean of two jackknife variances, of the run and of free motion. A "
              "95 % interval takes the factor of Student's t."),
        Equation('hat(K)_m = K_m m_L \\/ hat(m)_L',
                 "the torque constant: the one in use times the known mass over the apparent one", "torque-constant"),
    )),
    (records.TissueModel, (
        Prose("**Tissue.** There are four laws: linear ($nu = 1$, damping $B dot(d)$) or a power of depth, each with "
              "damping or without ($B = 0$). The simplest law is taken whose prediction of left-out pushes is not "
              "clearly worse than the best (Hunt and Crossley, 1975)."),
        Equation("F_T = F_0 + K_T d^nu + B d^nu dot(d)",
                 "force on tissue: offset, stiffness times a power of depth, and damping times that power and the "
                 "rate", "tissue-law"),
    )),
    (records.Whiteness, (
        Prose("**Whiteness** is tested by the autocorrelation, its 95 % band $1.96 \\/ sqrt(N)$, and the Ljung-Box "
              "statistic over 20 lags. A signal is called white if its p-value exceeds 1 %. The cumulative "
              "periodograms of innovations must pass, too, by their Kolmogorov-Smirnov distance from a straight "
              "line (Bartlett, 1955)."),
    )),
)  # fmt: skip


@section_of("Methods", "methods")
def section(context: Context) -> Iterator[Block]:
    """Prose and equations in the order of the stages; symbols, thresholds, a paragraph for a paper, and references."""
    lowpass = f"{context.study.settings.lowpass:g}"
    for block in (block for kind, method in METHODS if context.catalogue.records(kind) for block in method):
        yield Prose(block.text.format(lowpass=lowpass)) if isinstance(block, Prose) else block
    header = ("Quantity", "Measure", "Good", "Caution", "Problem")
    yield Table("The thresholds of the verdicts of this report.", header, thresholds(), "thresholds", "lllll")
    yield Table("Symbols.", ("Symbol", "Is", "Unit"), SYMBOLS, "symbols", "lll")
    if context.own_fits():
        yield Section("A paragraph for a paper", "paragraph", (Listing(paragraph_for_paper(context)),))
    references = tuple(map(reference, ENTRY.findall(bibliography())))
    yield Section("References", "references", (Bullets(references),))


def bibliography() -> str:
    """The references as BibTeX, which stands beside the report."""
    return text_of(read_bytes(BIBLIOGRAPHY))


def reference(entry: str) -> str:
    """A BibTeX entry as the report prints it, with its DOI if there is one."""
    has = dict(FIELD.findall(entry))
    names = [" ".join(reversed(name.split(", "))) for name in has.get("author", "").split(" and ")]
    place = next((has[name] for name in ("journal", "booktitle", "publisher", "school") if name in has), "")
    issue = f" {has['volume']} ({has['number']}), {has['pages'].replace('--', '–')}" if "volume" in has else ""
    doi = f", doi:{has['doi']}" if "doi" in has else ""
    text = f"{', '.join(names)}: {has['title']}. {place}{issue}, {has.get('year', '')}{doi}."
    return text.removeprefix(": ").replace(", .", ".")


def paragraph_for_paper(context: Context) -> str:
    """A paragraph on the method with this study's numbers, for a paper."""
    settings, robot = context.study.settings, context.study.robot
    logs = {log for fit in context.own_fits() for log in fit.logs}
    summaries = [summary for summary in context.catalogue.records(records.LogSummary) if summary.log in logs]
    rates = " to ".join(dict.fromkeys(f"{rate:.4g}" for rate in sorted(s.rate for s in summaries)))
    averaged = ", averaged over periods" if context.catalogue.records(records.Trajectory) else ""
    slowest = f"the slowest that shows 90 % of a push of 1 s at most {settings.delay:g} s late"
    walk = f"of intensity {settings.q_tau:g} effort/s^0.5" if settings.q_tau else f"({slowest})"
    scores = "; ".join(filter(None, (unseen_score(context, joint.name) for joint in robot.joints))) or "none"
    logs_in_words = count(len(logs), "simulated log" if context.study.simulated else "recording")
    kind = "a simulated arm" if context.study.simulated else "an arm"
    return fill(
        f"External efforts of {kind} ({robot.title}) were estimated from motor efforts and joint positions with "
        f"davinci-forces {context.provenance.version} (code {context.provenance.code}). Parameters were identified "
        f"from {logs_in_words} ({', '.join(sorted(logs))}) of "
        f"{sum(s.duration for s in summaries):.0f} s in all at {rates} Hz{averaged}; the model was "
        f"{'selected by cross-validation over blocks of path' if settings.fit == CHOSEN else settings.fit}. Model, "
        "error (root mean square, beyond noise) on unseen data, and level below which 99 % of free-motion samples "
        f"stay: {scores}. For the errors, effort and prediction passed one low-pass of {settings.lowpass:g} "
        "Hz without delay. The external effort was tracked by an extended Kalman filter with position, velocity and "
        f"external effort as states, the last as a random walk {walk}. Standard errors (±) allow for "
        "autocorrelation, by restricted likelihood (Patterson and Thompson, 1971) or blocks (Künsch, 1989).",
        88, break_on_hyphens=False,
    )  # fmt: skip


def unseen_score(context: Context, joint: str) -> str:
    """The model that a joint's effort was judged with, its error on the worst unseen log, and its detection level."""
    trusted = trust(context, joint)
    if (p := trusted.prediction) is None:
        return ""
    error, level = context.number(f"{p.prefix}.model_error", 2), ""
    if trusted.space is not None:
        level = f", level {context.number(f'{trusted.space.prefix}.detection_level', 2)}"
    model = context.used_fit(joint)
    if (used := context.used_record(joint)) is not None:
        friction = ", ".join(name for name in of_joint(used, joint).values() if "friction" in name)
        model = f"{used.structure}, {len(used)} parameters with {friction}, by {used.estimator}"
    where = f"{p.log}, on the fitted path" if trusted.same_path else p.log
    return (
        f"{joint.replace('_', ' ')}: {model}; error {error} ({percent(trusted.share)} of the effort) on {where}{level}"
    )
