"""How fast the filter runs, beside the same loop in C++."""

import ctypes
import shutil
import subprocess
import time
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

from pipeline.filters.ekf import FIRST, track
from pipeline.filters.problem import NoiseModel
from pipeline.maths.models.model import JointDynamics

N = 1_000_000
AT_MOST = 1.2  # times the time of C++ -O3
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


def track_in_cpp(loop, joint, q, dq, tau):
    """What `track` does, with the loop in C++: the same arrays made, the same arrays filled."""
    drive, out = tau - joint.known, np.empty((7, len(q)))
    short = np.array(joint.coefficients), np.array(NOISE)
    c, noise, inertia, y_q, y_dq, u, into = (
        x.ctypes.data_as(ctypes.c_void_p) for x in (*short, joint.inertia, q, dq, drive, out)
    )
    T_s, first_std, first = map(ctypes.c_double, (1e-3, 1.0, FIRST))
    loop(c, inertia, y_q, y_dq, u, ctypes.c_long(len(q)), T_s, noise, first_std, first, into)
    return out


def seconds(work) -> float:
    start = time.perf_counter()
    work()
    return time.perf_counter() - start


def test_a_million_samples_take_at_most_a_fifth_longer_than_in_cpp(rival, capsys):
    t = np.arange(N) * 1e-3
    rng = np.random.default_rng(0)
    q, dq = 0.4 * np.sin(t) + 1e-4 * rng.normal(size=N), 0.4 * np.cos(t) + 1e-3 * rng.normal(size=N)
    tau = -0.2 * np.sin(t) + 0.3 * np.sign(np.cos(t)) + 0.1 * rng.normal(size=N)
    joint = JointDynamics(np.full(N, 0.5), (0.1, 0.7, -0.2, 0.0, 0.3, 0.2, 0.0), np.zeros(N))
    ours = track(joint, q, dq, tau, 1e-3, NOISE, 1.0)  # compiles, or reads what was compiled
    theirs = track_in_cpp(rival, joint, q, dq, tau)
    for a, b in zip(ours, theirs, strict=True):
        assert_allclose(a, b, rtol=1e-9, atol=1e-9 * np.abs(b).max())
    turns = [
        (
            seconds(lambda: track(joint, q, dq, tau, 1e-3, NOISE, 1.0)),
            seconds(lambda: track_in_cpp(rival, joint, q, dq, tau)),
        )
        for _ in range(9)
    ]
    ratio = min(ours for ours, _ in turns) / min(theirs for _, theirs in turns)  # the others were disturbed
    with capsys.disabled():
        print(f"\nfilter of 1e6 samples: {ratio:.2f} times the time of C++ -O3", end="")
    assert ratio <= AT_MOST
