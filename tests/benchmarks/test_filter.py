"""How fast the filter runs, beside the same loop in C++ and a filter of a well-known library."""

import ctypes
import shutil
import subprocess
import time
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest
from numpy.testing import assert_allclose

from davinci_forces.filters import tracker
from davinci_forces.filters.problem import FilterInput, NoiseModel
from davinci_forces.filters.sample import INITIAL_VARIANCE_RATIO
from davinci_forces.filters.stepping import covariances
from davinci_forces.maths.models.model import JointDynamics
from davinci_forces.records import Track
from davinci_forces.records.store import Writer

N = 1_000_000
AT_MOST = 1.2  # times the time of C++ -O3
EKF = tracker("ekf")
NOISE = NoiseModel(1e-4, 1e-3, 1e-5, 1e-3, 0.05)


@pytest.fixture(scope="module")
def rival(tmp_path_factory):
    """The loop of `ekf.cpp`, compiled."""
    compiler = shutil.which("g++") or shutil.which("c++")
    if not compiler:
        pytest.skip("no C++ compiler on the path: the filter's time is compared with nothing")
    library = tmp_path_factory.mktemp("cpp") / "ekf.so"
    source = Path(__file__).with_name("ekf.cpp")
    flags = ["-O3", "-march=native", "-ffp-contract=off", "-shared", "-fPIC"]
    subprocess.run([compiler, *flags, source, "-o", library], check=True)
    return getattr(ctypes.CDLL(str(library)), "pass")


def recording() -> FilterInput:
    """Anew: a million samples of a joint with gravity and friction."""
    t = np.arange(N) * 1e-3
    rng = np.random.default_rng(0)
    q, dq = 0.4 * np.sin(t) + 1e-4 * rng.normal(size=N), 0.4 * np.cos(t) + 1e-3 * rng.normal(size=N)
    tau = -0.2 * np.sin(t) + 0.3 * np.sign(np.cos(t)) + 0.1 * rng.normal(size=N)
    joint = JointDynamics(np.full(N, 0.5), (0.1, 0.7, -0.2, 0.0, 0.3, 0.2, 0.0), np.zeros(N))
    return FilterInput(joint, q, dq, -q, tau, 1e-3, 1.0)


def track_in_cpp(loop, recording):
    """What the filter does, with the loop in C++: the same arrays made, the same arrays filled."""
    joint = recording.joint
    drive, out = recording.tau - joint.known, np.empty((7, N))
    short = np.array(joint.coefficients), np.array(NOISE)
    columns = (*short, joint.inertia, recording.q, recording.dq, drive, out)
    c, noise, inertia, y_q, y_dq, u, into = (x.ctypes.data_as(ctypes.c_void_p) for x in columns)
    T_s, initial_std, first = map(ctypes.c_double, (1e-3, 1.0, INITIAL_VARIANCE_RATIO))
    loop(c, inertia, y_q, y_dq, u, ctypes.c_long(N), T_s, noise, initial_std, first, into)
    return out


def seconds(work) -> float:
    start = time.perf_counter()
    work()
    return time.perf_counter() - start


def shortest(*works) -> list[float]:
    """The shortest of nine turns of each work on a recording made anew, by turns; the others were disturbed."""

    def turn(work) -> float:
        made = recording()
        return seconds(lambda: work(made))

    return np.min([[turn(work) for work in works] for _ in range(9)], axis=0).tolist()


def said(capsys, text: str) -> None:
    with capsys.disabled():
        print(f"\n{text}", end="")


def test_a_million_samples_take_at_most_a_fifth_longer_than_in_cpp(rival, capsys):
    ours = EKF(recording(), NOISE)  # compiles, or reads what was compiled
    for a, b in zip(ours, track_in_cpp(rival, recording()), strict=True):
        assert_allclose(a, b, rtol=1e-9, atol=1e-9 * np.abs(b).max())
    mine, theirs = shortest(lambda made: EKF(made, NOISE), lambda made: track_in_cpp(rival, made))
    said(capsys, f"filter of 1e6 samples: {mine / theirs:.2f} times the time of C++ -O3")
    assert mine <= AT_MOST * theirs


def test_the_smoother_takes_at_most_two_and_a_half_times_as_long_as_the_filter(capsys):
    filter_, smoother = (f(recording(), NOISE) for f in (EKF, tracker("rts")))  # compiles, or reads what was compiled
    assert_allclose(smoother.tau_ext[-1], filter_.tau_ext[-1], rtol=1e-9)  # the last sample has nothing after it
    assert smoother.tau_ext_std[N // 2] < filter_.tau_ext_std[N // 2]
    filtered, smoothed = shortest(lambda made: EKF(made, NOISE), lambda made: tracker("rts")(made, NOISE))
    said(capsys, f"filter and smoother of 1e6 samples: {smoothed / filtered:.2f} times the filter")
    assert smoothed <= 2.5 * filtered


def test_the_filter_is_three_hundred_times_as_fast_as_filterpys(capsys):
    kalman = pytest.importorskip("filterpy.kalman", reason="filterpy is not installed: `make oracles`")
    few, data = 3000, recording()
    EKF(data, NOISE)  # compiles, or reads what was compiled
    filtered: list[float] = []
    R_q, R_dq, Q_qq, Q_qd, Q_dd, Q_tau = covariances(NOISE, 1e-3)

    def theirs():
        """The linear part of the same step: fewer sums than ours."""
        ekf = kalman.ExtendedKalmanFilter(dim_x=3, dim_z=2)
        ekf.x, ekf.P = np.zeros((3, 1)), np.eye(3)
        ekf.F = np.array([[1, 1e-3, 0], [0, 1 - 1e-3 * 0.3 / 0.5, -1e-3 / 0.5], [0, 0, 1]])
        ekf.Q = np.array([[Q_qq, Q_qd, 0], [Q_qd, Q_dd, 0], [0, 0, Q_tau]])
        ekf.R, H = np.diag([R_q, R_dq]), np.eye(2, 3)
        for k in range(few):
            ekf.update(np.array([[data.q[k]], [data.dq[k]]]), lambda x: H, lambda x: H @ x)
            filtered.append(float(ekf.x[0, 0]))
            ekf.predict()

    (own,), rival = shortest(lambda made: EKF(made, NOISE)), seconds(theirs) / few
    assert_allclose(filtered, data.q[:few], rtol=0, atol=0.02)  # it followed what was measured
    said(capsys, f"a sample of the filter: 1/{rival * N / own:.0f} of filterpy's; {N} samples")
    assert rival >= 300 * own / N


def test_storing_a_track_takes_at_most_six_times_as_long_as_filtering_it(tmp_path, capsys):
    def record() -> Track:
        made = recording()
        columns = dict.fromkeys(Track.columns(), made.tau) | {"t": np.arange(N) * 1e-3} | EKF(made, NOISE)._asdict()
        scalars = dict.fromkeys(Track.scalars(), 0.0) | dict.fromkeys(("log", "joint", "model", "estimator"), "x")
        return Track(**scalars | columns | {"filter": "ekf", "role": "contact", "path": "", "band_from": ""})

    def store(record: Track) -> None:
        with Writer(tmp_path, lambda _: lambda unit: unit, {}) as writer:
            writer.write(record)

    def seconds_of_storing() -> float:
        anew = record()
        return seconds(lambda: store(anew))

    (filtered,) = shortest(lambda made: EKF(made, NOISE))
    stored = min(seconds_of_storing() for _ in range(9))
    [file] = tmp_path.rglob("*.parquet")
    assert_allclose(pq.read_table(file, columns=["tau_ext"])["tau_ext"], record().tau_ext, rtol=0, atol=0)
    said(capsys, f"storing a track of 1e6 samples: {stored / filtered:.1f} times filtering it")
    assert stored <= 6 * filtered
