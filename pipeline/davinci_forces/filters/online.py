"""External efforts sample by sample, by a model as `exports.json` writes it: what a controller would see.

Position, velocity and acceleration come from a cubic polynomial through the samples around the instant of the estimate
(Savitzky and Golay 1964).  Its window passes the motion that the model was fitted to, so the estimate is `delay`
seconds older than the newest sample.  The filter's step is that of `sample`, with the noise and the band of the model.

Exports copy this file and `sample`; they need numpy alone, and Python 3.10 or later.  Nothing here connects to a robot.
"""

import math
import warnings
from bisect import bisect_left
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from davinci_forces.filters.sample import bias, correct, first, predict, sign, transition

Array = NDArray[Any]  # of floats
OK, STARTING, OUTSIDE_VALIDITY, BAD_INPUT = "ok", "starting", "outside validity", "bad input"
OTHER_RATE = "other rate"
FUNCTIONS = ("1", "sin q", "cos q", "q", "dq", "sign(dq)", "z")  # of the coefficients of a term
INERTIAL = ("m", "mx", "my", "mz", "Ixx", "Ixy", "Ixz", "Iyy", "Iyz", "Izz")
ORDER = 3  # of the polynomial through the samples of a window
GAP = 1.5  # sampling times; a longer wait restarts the filter
PACE_SAMPLES = 200  # over which the mean sampling time is taken, so that jitter averages out
MAX_PACE_ERROR = 0.02  # of the sampling time; measured: it moves an estimate by less than its standard deviation
TRANSIENT = 1.0  # [s] after which the filter has forgotten how it began
STILL = 3.0  # standard deviations of the velocity's noise, below which a joint stands still
DOUBTFUL = 0.67  # likewise, below which the sign of the velocity is that of its noise
YZX, ZXY = np.array([1, 2, 0]), np.array([2, 0, 1])
SINGULAR = 1e4  # condition number of the Jacobian, above which the efforts do not determine a force
Z_OF_MOTION: dict[str, Callable[[float, float], float]] = {
    "|dq|": lambda q, dq: abs(dq),
    "|dq| dq": lambda q, dq: abs(dq) * dq,
    "q dq": lambda q, dq: q * dq,
    "q sign(dq)": lambda q, dq: q * sign(dq),
    "q^2 sign(dq)": lambda q, dq: q * q * sign(dq),
    "q^2": lambda q, dq: q * q,
    "q^3": lambda q, dq: q * q * q,
    "sin 2q": lambda q, dq: math.sin(2.0 * q),
    "cos 2q": lambda q, dq: math.cos(2.0 * q),
    "sin 3q": lambda q, dq: math.sin(3.0 * q),
    "cos 3q": lambda q, dq: math.cos(3.0 * q),
}


@dataclass(frozen=True)
class OnlineEffort:
    """The external efforts on the joints (m,) at time t [s], which is `delay` before the newest sample.

    Numbers are NaN while the first window fills, and where the status of a joint is "bad input" or "other rate".  The
    status is "starting" for another second, in which the filter forgets how it began.  `std` contains the filter's lag,
    as far as the change of `tau_ext` shows it.  `contact` is 1 above the alarm level, 0 below, and -1 without a level
    or while it starts.  `force` (3,) [N] is at the tip, in base axes; NaN where unknown.
    """

    t: float
    status: tuple[str, ...]
    q: Array
    dq: Array
    tau_hat: Array
    tau_ext: Array
    std: Array
    contact: NDArray[np.int64]
    force: Array


class TermValue(NamedTuple):
    """A parameter's value, its factor of acceleration, coefficients (7,), and what its state z depends on."""

    value: float
    acceleration: float
    c: tuple[float, ...]
    kind: str
    scale: float


class LinkTree:
    """The links of an arm, of which each set of inertial parameters gives efforts.  Featherstone 2008, chapter 5."""

    def __init__(self, chain: Mapping[str, Any], gravity: float) -> None:
        links = chain["links"]
        self.names = [link["name"] for link in links]
        self.parent = [0 if link["parent"] is None else link["parent"] + 1 for link in links]
        self.coordinate = [-1 if link["coordinate"] is None else link["coordinate"] for link in links]
        self.slides = [bool(link["prismatic"]) or k < 0 for link, k in zip(links, self.coordinate, strict=True)]
        self.placement = [np.array(link["placement"], float)[:3] for link in links]
        self.gravity = gravity * np.array(chain["up"], float)
        self.tip_body: Array | None = None  # 1 kg at the tip
        if (tip := chain.get("tip")) and tip["link"] is not None:
            self.tip_body = np.zeros((len(links), len(INERTIAL)))
            self.tip_body[tip["link"], :4] = 1.0, *tip["position"]

    def efforts(self, bodies: Array, q: Array, dq: Array, ddq: Array, up: Array) -> Array:
        """Efforts (B, n) of motions (B, n) of links with bodies (L, 10); `up` (B, 3) opposes gravity."""
        R, r = list[Array](), list[Array]()  # of the links in the frames of their parents
        for k, slides, T in zip(self.coordinate, self.slides, self.placement, strict=True):
            x: Array = q[:, k, None] if k >= 0 else np.zeros((len(q), 1))
            c, s = (np.ones_like(x), np.zeros_like(x)) if slides else (np.cos(x), np.sin(x))
            R.append(np.stack([c * T[:, 0] + s * T[:, 1], c * T[:, 1] - s * T[:, 0], T[:, 2] + 0.0 * x], axis=-1))
            r.append(T[:, 3] + (x * T[:, 2] if slides else 0.0 * x))
        w, e = [np.zeros((len(q), 3))], [np.zeros((len(q), 3))]
        a, f, n = [up], [np.zeros((len(q), 3))], [np.zeros((len(q), 3))]
        z = np.array([0.0, 0.0, 1.0])
        for i, (parent, k, slides) in enumerate(zip(self.parent, self.coordinate, self.slides, strict=True)):
            v, u = (dq[:, k, None], ddq[:, k, None]) if k >= 0 else (np.zeros((len(q), 1)),) * 2
            m, h, Io = bodies[i, 0], bodies[i, 1:4], bodies[i, [4, 5, 6, 5, 7, 8, 6, 8, 9]].reshape(3, 3)
            of, w_i = a[parent] + _carried(w[parent], e[parent], r[i]), _turned(R[i], w[parent])
            e_i, a_i, turn = _turned(R[i], e[parent]), _turned(R[i], of), _cross(w_i, z)
            if slides:
                a_i = a_i + 2.0 * v * turn + u * z
            else:
                e_i, w_i = e_i + v * turn + u * z, w_i + v * z
            w.append(w_i)
            e.append(e_i)
            a.append(a_i)
            f.append(m * a_i + _carried(w_i, e_i, h))
            n.append(e_i @ Io + _cross(w_i, w_i @ Io) + _cross(h, a_i))
        tau = np.zeros_like(q)
        for i in range(len(self.parent) - 1, -1, -1):
            parent, k = self.parent[i], self.coordinate[i]
            if k >= 0:
                tau[:, k] += f[i + 1][:, 2] if self.slides[i] else n[i + 1][:, 2]
            force = np.einsum("bij,bj->bi", R[i], f[i + 1])
            f[parent] = f[parent] + force
            n[parent] = n[parent] + np.einsum("bij,bj->bi", R[i], n[i + 1]) + _cross(r[i], force)
        return tau

    def tip_jacobian(self, q: Array) -> Array:
        """The Jacobian (3, n) of the tip's position at q (n,): the efforts of 1 N there along each axis of the base."""
        assert self.tip_body is not None
        still = np.zeros((3, len(q)))
        return self.efforts(self.tip_body, q + still, still, still, np.eye(3))


def _cross(a: Array, b: Array) -> Array:
    return np.asarray(a.take(YZX, -1) * b.take(ZXY, -1) - a.take(ZXY, -1) * b.take(YZX, -1))


def _carried(w: Array, e: Array, r: Array) -> Array:
    """The acceleration of a point r from its frame, which turns with w and e."""
    return _cross(e, r) + _cross(w, _cross(w, r))


def _turned(R: Array, x: Array) -> Array:
    """A vector (B, 3) of a parent's axes in those of a link."""
    return np.asarray(np.einsum("bji,bj->bi", R, x))


class Window(NamedTuple):
    """The samples around an instant, and their weights for a signal and two derivatives, and for a sample as it is."""

    middle: int  # samples before the newest at which the window has its middle
    half: int  # samples on either side of the middle
    smooth: Array  # (3, 2 half + 1)
    exact: Array  # (2 half + 1,)

    @classmethod
    def design(cls, rate: float, cutoff: float, place: float) -> "Window":
        """The window of a cutoff [Hz] for the instant `place` [s] before the newest sample."""
        half, before = half_width(rate, cutoff), place * rate
        middle = round(before)
        exact = np.eye(2 * half + 1)[half]
        if abs(before - middle) > 1e-6:  # between samples: a polynomial through five of them
            exact[half - 2 : half + 3] = weights(2, middle - before, rate, 4)[0]
        return cls(middle, half, weights(half, middle - before, rate), exact)

    def apply(self, samples: Array, weights: Array) -> Array:
        """Weigh the newest samples (N, ...)."""
        stop = len(samples) - self.middle + self.half
        return np.asarray(weights @ samples[stop - 2 * self.half - 1 : stop])

    def filter_signal(self, x: Array, derivative: int) -> Array:
        """A derivative of a signal (N,) at every sample, delayed by `place`; its ends are continued as they are."""
        before, after = self.half + self.middle, self.half + max(-self.middle, 0)
        padded = np.concatenate([np.full(before, x[0]), x, np.full(after, x[-1])])
        return np.convolve(padded, self.smooth[derivative, ::-1], "valid")[: len(x)]


def delay_of(processing: Sequence[tuple[float, float, float]]) -> float:
    """The delay [s] that the windows of joints with these rates, cutoffs [Hz] and lags of the effort [s] need."""
    return max((math.ceil(half_width(r, c) - lag * r - 1e-6) / r for r, c, lag in processing), default=0.0)


def half_width(rate: float, cutoff: float) -> int:
    """Samples on either side of an instant, through which a cubic passes at most half of the size at `cutoff` [Hz].

    As in the analysis, a cutoff at or above 0.4 of the rate removes nothing.
    """

    def removes(half: int) -> bool:  # of a width, and of any larger one
        k = np.arange(-half, half + 1)
        return bool(weights(half, 0.0, rate)[0] @ np.cos(2.0 * np.pi * cutoff / rate * k) <= 0.5)

    return 2 + (bisect_left(range(2, 3 + math.ceil(rate / cutoff)), True, key=removes) if cutoff < 0.4 * rate else 0)


def weights(half: int, place: float, rate: float, order: int = ORDER) -> Array:
    """Weights (3, 2 half + 1) of samples for a signal and two derivatives, `place` samples from the middle one."""
    k = np.arange(-half, half + 1) - place
    fit = np.linalg.pinv(k[:, None] ** np.arange(order + 1))[:3]
    return np.asarray(fit * np.array([[1.0], [rate], [2.0 * rate**2]]))


class OnlineJoint:
    """The filter of one joint of a model, with its belief and the states of its friction."""

    def __init__(
        self, joint: Mapping[str, Any], model: Mapping[str, Any], coordinates: Sequence[str], links: LinkTree
    ) -> None:
        parameters, tuned = model["parameters"], joint["filter"]
        self.name, self.row = joint["name"], list(coordinates).index(joint["name"])
        self.coupled = model["structure"] == "coupled"
        self.terms = [_term(p) for p in parameters if p["joint"] == self.name]
        self.bodies = np.zeros((len(links.names), len(INERTIAL)))
        for p in parameters:
            if p["role"] == "link":
                self.bodies[links.names.index(p["link"]), INERTIAL.index(p["inertial"])] = p["value"]
        self.valid = [joint["validity"][name] for name in ("position", "velocity")]  # a contact adds to the effort
        self.R, Q = tuned["R"], tuned["Q"]
        self.Q = Q[0][0], Q[0][1], Q[1][1], Q[2][2]
        self.T_s, self.initial_std = 1.0 / tuned["rate"], tuned["initial_std"]
        self.band = tuned["band"] or {"edges": [math.inf], "factor": [1.0, 1.0], "model_variance": 0.0}
        self.alarm, self.static = tuned["alarm_level"], tuned["static_friction"]
        self.follow = min(self.T_s / max(tuned.get("lag", 0.0), self.T_s), 1.0)  # of an effort late by as much again
        own = range(4, 6) if self.coupled else range(6)  # coefficients that the filter computes at its own state
        self.c = tuple(sum(t.value * t.c[i] for t in self.terms) if i in own else 0.0 for i in range(len(FUNCTIONS)))
        self.restart()

    def restart(self) -> None:
        """Forget the belief and the friction's memory, as after a gap."""
        self.belief: Any = None
        self.z, self.late, self.steps = [0.0] * len(self.terms), 0.0, 0

    @property
    def has_converged(self) -> bool:
        """Whether the filter has run long enough to have forgotten how it began."""
        return bool(self.steps * self.T_s > TRANSIENT)

    def step(
        self, y: tuple[float, float], motion: Sequence[float], tau: float, of_links: float, M: float
    ) -> tuple[float, ...]:
        """Filter a sample: the model's effort, the external one, and its deviation by the filter and in total.

        A ramp is shown late by what it changes in the filter's lag.  That is its distance from the same effort, late
        by as much again; of it, one standard deviation is due to noise.
        """
        q, dq, ddq = motion
        M += sum(t.value * t.acceleration for t in self.terms)
        tau_hat = of_links + sum(
            t.value * (t.acceleration * ddq + bias(t.c, q, dq, _state(t, z, q, dq))[0])
            for t, z in zip(self.terms, self.z, strict=True)
        )
        known = tau_hat - M * ddq - bias(self.c, q, dq, 0.0)[0]
        if self.belief is None:
            self.belief = first(y[0], y[1], math.sqrt(self.R[0]), math.sqrt(self.R[1]), self.initial_std)
        now, *_ = correct(self.belief, y[0], y[1], self.R[0], self.R[1])
        for i, term in enumerate(self.terms):
            if term.kind == "deflection":
                self.z[i] = sign(dq) - (sign(dq) - self.z[i]) * math.exp(-abs(dq) * self.T_s / term.scale)
        q_next, dq_next, F, friction_var = transition(
            now[0], now[1], now[2], now[6], tau - known, M, self.c, self.T_s, 0.5 * self.T_s * self.T_s
        )
        Q_qq, Q_qd, Q_dd, Q_tau = self.Q
        self.belief = predict(now, q_next, dq_next, F, Q_qq, Q_qd, Q_dd + friction_var, Q_tau)
        speed = sum(abs(dq) > edge for edge in self.band["edges"])
        total = self.band["factor"][speed] * math.sqrt(now[8] + self.band["model_variance"])
        total = max(math.sqrt(now[8]), total)
        self.late = now[2] if not self.steps else self.late + self.follow * (now[2] - self.late)
        self.steps += 1
        return tau_hat, now[2], math.sqrt(now[8]), math.hypot(total, max(abs(now[2] - self.late) - total, 0.0))


def _term(p: Mapping[str, Any]) -> TermValue:
    state = p["state"] or {"kind": ""}
    kind = state["function"] if state["kind"] == "function" else state["kind"]
    scale = next((value for key, value in state.items() if key not in ("kind", "function")), 0.0)
    c = tuple(float(p["functions"].get(f, 0.0)) for f in FUNCTIONS)
    return TermValue(p["value"], p["acceleration"], c, kind, scale)


def _state(term: TermValue, memory: float, q: float, dq: float) -> float:
    """The state z of a term; `memory` is that of a deflection."""
    if term.kind == "deflection":
        return memory
    if term.kind == "smooth sign":
        return math.tanh(dq / term.scale)
    if term.kind == "Stribeck":
        v = dq / term.scale
        return sign(dq) * math.exp(-v * v)
    return Z_OF_MOTION[term.kind](q, dq) if term.kind else 0.0


class Stream:
    """The external efforts of an arm from samples as they arrive: `step(t, q, tau)`.

    It is made of the content of an exported model.json.  `coordinates` are the joints that `q`, `tau` and `dq` are
    over, and `joints` those with estimates.  `rate` [Hz] is that of the samples, and `delay` [s] that of the estimate.
    `offset` is an effort per joint that is subtracted, 0 unless it is set.

    Raises ValueError if a joint has no filter, or joints have different rates.
    """

    def __init__(self, model: Mapping[str, Any]) -> None:
        joints, models = model["joints"], model["models"]
        if missing := [j["name"] for j in joints if not j["filter"]]:
            raise ValueError(f"no identification log gives the filter noise of {missing[0]}; leave that joint out")
        rates = sorted({j["filter"]["rate"] for j in joints})
        if len(rates) != 1:
            listed = ", ".join(f"{rate:g}" for rate in rates)
            raise ValueError(f"the filters of the joints have several rates ({listed} Hz); export the model again")
        every, chain = list(model["coordinates"]), model["chain"] or {"links": [], "up": [0.0, 0.0, 1.0], "tip": None}
        names = [j["name"] for j in joints]
        coupled = any(models[j["model"]]["structure"] == "coupled" for j in joints)
        self.coordinates, self.joints = tuple(every if coupled else names), tuple(names)
        self.links = LinkTree(chain, model["gravity"])
        self.filters = [OnlineJoint(j, models[j["model"]], self.coordinates, self.links) for j in joints]
        self.rate, self.offset = float(rates[0]), np.zeros(len(names))
        self.has_tip = names == every and len(every) == 3 and self.links.tip_body is not None
        self.has_tip = self.has_tip and all(j["units"]["effort"] in ("N m", "N") for j in joints)
        processing = [(self.rate, j["motion"]["cutoff"], j["motion"]["effort_lag"]) for j in joints]
        self.delay = max(delay_of(processing), 0.0)
        self._windows = [Window.design(rate, cutoff, self.delay + lag) for rate, cutoff, lag in processing]
        self._samples: deque[Any] = deque(maxlen=max(w.middle + w.half + 1 for w in self._windows))
        self._t, self._pace = -math.inf, 0.0  # pace: mean time between samples over the filter's, minus 1
        self._latest: deque[float] = deque(maxlen=5)  # times

    def restart(self) -> None:
        """Forget all samples and their times, so that a log may begin again."""
        self._t, self._pace = -math.inf, 0.0
        self._latest.clear()
        self._restart_filters()

    def _restart_filters(self) -> None:
        self._samples.clear()
        for joint in self.filters:
            joint.restart()

    def step(self, t: float, q: ArrayLike, tau: ArrayLike, dq: ArrayLike | None = None) -> OnlineEffort:
        """Take a sample at t [s]: positions, efforts and, if the arm measures them, velocities over `coordinates`.

        A sample that is not finite, or not later than the one before, leaves everything as it was.  After a gap of
        more than 1.5 sampling times, the filter starts anew.  Samples at another rate than the filter's, by 2 % on
        average or gap after gap, have the status "other rate", and a warning names both rates.  Give `dq` always or
        never.
        """
        sample = [np.array(x, float).ravel() for x in (q, tau, dq) if x is not None]
        if any(len(x) != len(self.coordinates) for x in sample):
            raise ValueError(f"q, tau and dq have one number for each of {', '.join(self.coordinates)}")
        if self._samples and len(sample) != len(self._samples[-1]):
            raise ValueError("give dq in every step or in none; `restart` begins anew")
        used = [sample[0], sample[1][[joint.row for joint in self.filters]], *sample[2:]]
        if not (math.isfinite(t) and t > self._t and all(np.isfinite(x).all() for x in used)):
            return self._unknown(t, BAD_INPUT)
        other_rate, gap = self._follow_rate(t), t - self._t > GAP / self.rate
        if other_rate or gap:
            self._restart_filters()
        self._t = t
        self._samples.append(sample)
        if other_rate:
            return self._unknown(t, OTHER_RATE)
        if len(self._samples) < self._samples.maxlen:  # type: ignore[operator]
            return self._unknown(t, STARTING)
        return self._estimate(t - self.delay)

    def _follow_rate(self, t: float) -> bool:
        """Update the pace; return whether samples come at another rate, and warn when that begins.

        A gap counts if it follows another, and then as the shortest gap.
        """
        before, interval = abs(self._pace) > MAX_PACE_ERROR, (t - self._t) * self.rate
        self._latest.append(t)
        if interval <= GAP or len(self._samples) == 1:
            self._pace += (min(interval, GAP) - 1.0 - self._pace) / PACE_SAMPLES
        other = abs(self._pace) > MAX_PACE_ERROR
        if other and not before:
            rate = (len(self._latest) - 1) / (self._latest[-1] - self._latest[0])
            remedy = "resample them to the rate of the filter, or identify the model from logs at theirs"
            warnings.warn(f"samples come at {rate:.4g} Hz, the filter takes {self.rate:.4g} Hz; {remedy}", stacklevel=3)
        return other

    def _unknown(self, t: float, status: str) -> OnlineEffort:
        m = len(self.joints)
        q, dq, tau_hat, tau_ext, std = (np.full(m, np.nan) for _ in range(5))
        none = np.full(m, -1, np.int64)
        return OnlineEffort(t - self.delay, (status,) * m, q, dq, tau_hat, tau_ext, std, none, np.full(3, np.nan))

    def _estimate(self, t: float) -> OnlineEffort:
        columns = [np.array(column) for column in zip(*self._samples, strict=True)]
        q_all, tau_all, logged = columns[0], columns[1], columns[2] if len(columns) > 2 else None
        tau, rows, status = tau_all[-1 - round(self.delay * self.rate)], [], []
        for i, joint in enumerate(self.filters):
            w, row = self._windows[i], joint.row
            q, v, a = w.apply(q_all, w.smooth)
            y = w.apply(q_all, w.exact)[row], v[row]
            if logged is not None:
                v, a, _ = w.apply(logged, w.smooth)
                y = y[0], w.apply(logged, w.exact)[row]
            noise = joint.R[0] * np.sum(w.smooth[1] ** 2) if logged is None else joint.R[1] * np.sum(w.smooth[0] ** 2)
            stands = abs(v[row]) < STILL * math.sqrt(noise)
            if abs(v[row]) < DOUBTFUL * math.sqrt(noise):
                v[row] = 0.0
            of_links, M = self._links_effort(joint, q, v, a)
            motion = [float(x[row]) for x in (q, v, a)]
            tau_hat, tau_ext, _, std = joint.step((float(y[0]), float(y[1])), motion, float(tau[row]), of_links, M)
            static = joint.static if stands else 0.0
            tau_ext -= self.offset[i]
            level = int(abs(tau_ext) > joint.alarm + static) if joint.has_converged and joint.alarm is not None else -1
            rows.append((motion[0], motion[1], tau_hat, tau_ext, math.sqrt(std**2 + static**2 / 3.0), level))
            inside = all(low <= x <= high for x, (low, high) in zip(motion[:2], joint.valid, strict=True))
            status.append((OK if inside else OUTSIDE_VALIDITY) if joint.has_converged else STARTING)
        values, contact = np.array([row[:5] for row in rows]).T, np.array([row[5] for row in rows], np.int64)
        force = self._force(values[0], values[3])
        q, dq, tau_hat, tau_ext, std = values
        return OnlineEffort(t, tuple(status), q, dq, tau_hat, tau_ext, std, contact, force)

    def _links_effort(self, joint: OnlineJoint, q: Array, dq: Array, ddq: Array) -> tuple[float, float]:
        """The effort of the links on a joint, and its inertia there; 0 of a joint by itself."""
        if not joint.coupled:
            return 0.0, 0.0
        unit, still = np.eye(len(q))[joint.row], np.zeros_like(q)
        q, dq, ddq = (np.stack(pair) for pair in ((q, q), (dq, still), (ddq, unit)))
        up = np.stack([self.links.gravity, np.zeros(3)])
        tau, M = self.links.efforts(joint.bodies, q, dq, ddq, up)[:, joint.row]
        return float(tau), float(M)

    def _force(self, q: Array, tau_ext: Array) -> Array:
        """The force (3,) at the tip: J_v' f = tau_ext; NaN where the pose does not determine it.  (7.26)"""
        if not self.has_tip:
            return np.full(3, np.nan)
        J = self.links.tip_jacobian(q)
        return np.asarray(np.linalg.solve(J.T, tau_ext)) if np.linalg.cond(J) < SINGULAR else np.full(3, np.nan)
