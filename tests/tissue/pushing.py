"""Pushes into tissue of a known stiffness, as records: by a force sensor, and by the joint that slides."""

import numpy as np
from scipy.signal import lfilter

from davinci_forces.records import Diagnostic, Push, Stiffness, TissueModel, Touch, Track
from davinci_forces.stages.tissue import palpate
from tests import arm
from tests.test_averaging import entry

K, SURFACE = 457.24, 0.04
# Section 8.2: slowly into tissue and out again, twice; times [s] and depths [m].
APPROACH = (
    (0, 0.0),
    (2, 0.0),
    (12, 0.08),
    (14, 0.08),
    (24, 0.0),
    (26, 0.0),
    (36, 0.08),
    (38, 0.08),
    (48, 0.0),
    (50, 0),
)
TWICE = ((0, 0.0), (2, 0.02), (4, 0.0), (6, 0.02), (8, 0.0))


def coloured(rng, N, std, rho):
    """A first-order autoregression."""
    return std * lfilter([np.sqrt(1 - rho**2)], [1, -rho], rng.normal(size=N))


def motion(corners, rate):
    t = np.arange(int(corners[-1][0] * rate)) / rate
    return t, np.interp(t, *np.array(corners, float).T)


def pressed(t, depth, k=K, b=0.0, n=1.0, surface=SURFACE):
    """The force of a spring with a damper, or of Hunt and Crossley where n is not 1; it never pulls."""
    x = np.clip(depth - surface, 0, None)
    damper = b * np.gradient(depth, t) * (1.0 if n == 1.0 else x**n)
    return np.where(x > 0, np.maximum(k * x**n + damper, 0), 0)


def touch(t=None, **columns) -> Touch:
    """A log of these columns; the others it has no channels of."""
    given = {name: np.asarray(values, float) for name, values in columns.items() if name != "push"}
    N = len(next(iter(given.values())))
    unknown = dict.fromkeys(Touch.UNKNOWN, np.full(N, np.nan)) | ({} if t is None else {"t": t})
    push = np.asarray(columns.get("push", np.zeros(N)), int)
    return Touch(log="run", role="tissue", sample=np.arange(N), push=push, **unknown | given)


def sensed(seed=0, corners=TWICE, rate=100.0, std=0.02, rho=0.0, surface=0.008, **tissue) -> Touch:
    """Pushes as a force sensor with an offset and noise tells them."""
    t, depth = motion(corners, rate)
    force = pressed(t, depth, surface=surface, **tissue)
    return touch(t, depth=depth, force=force + 0.3 + coloured(np.random.default_rng(seed), len(t), std, rho))


def slid(seed=0, std=0.5, model=0.1, lag=0.1, way=1.0, rest=6.0, band_from="free") -> Track:
    """The same by the slide: friction takes any value at rest, and the filter comes late."""
    t, depth = motion(APPROACH, 100.0)
    rng = np.random.default_rng(seed)
    force = pressed(t, depth)
    dq = np.gradient(depth, t)
    direct = way * force + np.where(np.abs(dq) < 1e-4, rest, 0.0) + std * rng.normal(size=len(t))
    late = way * np.interp(t - lag, t, force)
    zero = np.zeros_like(t)
    columns = dict.fromkeys(Track.columns(), zero) | {"t": t, "q": way * depth, "dq": way * dq, "tau_ext": late}
    columns |= {"tau_ext_direct": direct, "tau_ext_smooth_std": zero + 3.0}
    scalars = dict.fromkeys(Track.scalars(), 0.0) | {"at_rest": 0, "rate": 100.0, "filter": "ekf"}
    scalars |= {"model_part": model, "band_from": band_from}
    named = {"log": "run", "joint": "instrument_slide", "role": "tissue", "model": "m", "estimator": "e"}
    return Track(**columns, **scalars | named)


def palpated(touches=(), tracks=(), robot=arm.ARM, **changes):
    """What the stage makes: the tissue, the pushes, the models and the remarks; None and () where there are none."""
    about = entry(role="tissue", **changes)
    made = list(palpate.run(list(touches), list(tracks), about, robot, lowpass=17.0))
    tissue = next((r for r in made if isinstance(r, Stiffness)), None)
    models = next((r for r in made if isinstance(r, TissueModel)), None)
    said = [text for r in made if isinstance(r, Diagnostic) for text in r.text]
    return tissue, [r for r in made if isinstance(r, Push)], models, said
