"""Long logs are read, filtered and written in blocks: the results are those of the whole, and the memory is bounded."""

import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from scipy.signal import butter, sosfiltfilt

from davinci_forces.filters.problem import NoiseModel
from davinci_forces.identification import joint_models
from davinci_forces.maths import arrays
from davinci_forces.maths.models.model import ArmMotion, Regressor
from davinci_forces.maths.periods import harmonics
from davinci_forces.maths.signals import smoothing, whiteness
from davinci_forces.maths.signals.faults import beyond_steps
from davinci_forces.maths.uncertainty import error_band
from davinci_forces.records import JointModel, PeriodResidual, store
from davinci_forces.report.content.thinning import envelope
from tests.benchmarks.test_memory import hour_study, peak

RATE, N, BLOCK = 1000.0, 3500, 1000  # the last block is shorter
NOISE = NoiseModel(1e-4, 1e-3, 0.0, 1e-2, 0.05)
BYTES = 155  # the most memory that a further sample of a joint takes, in any stage or the report


@pytest.mark.parametrize("period", [50.0, 1500.0])
def test_samples_of_a_long_series_are_counted_in_blocks_as_over_the_whole(monkeypatch, period: float):
    """Of two correlation times, one longer than a block."""
    rng = np.random.default_rng(1)
    x = np.sin(2 * np.pi * np.arange(20_000) / period) + rng.normal(size=20_000)
    expected = error_band.count_uncorrelated(x)
    monkeypatch.setattr(error_band, "BLOCK_SAMPLES", 256)
    assert error_band.count_uncorrelated(x) == pytest.approx(expected, rel=1e-9)


def test_correlations_of_a_long_series_are_those_of_the_whole(monkeypatch):
    x, u = np.random.default_rng(1).standard_normal((2, N)) + 0.5
    x[3:] += u[:-3]
    expected = whiteness.cross_correlation(x, u, 20)
    monkeypatch.setattr(whiteness, "BLOCK_SAMPLES", BLOCK)
    np.testing.assert_allclose(whiteness.cross_correlation(x, u, 20), expected, rtol=0.0, atol=1e-12)


@pytest.mark.parametrize("cutoff", [0.1, 30.0])
def test_a_low_pass_in_blocks_has_the_bits_of_the_whole(monkeypatch, cutoff: float):
    """The padding of one is longer than the signal."""
    x = np.random.default_rng(1).standard_normal((N, 2))
    sos, pad = butter(smoothing.FILTER_ORDER, cutoff, fs=RATE, output="sos"), min(3 * round(RATE / cutoff) + 3, N - 1)
    expected = sosfiltfilt(sos, x, axis=0, padlen=pad)
    monkeypatch.setattr(arrays, "BLOCK_SAMPLES", BLOCK)
    np.testing.assert_array_equal(smoothing.lowpass(x, RATE, cutoff), expected)
    np.testing.assert_array_equal(smoothing.lowpass(x[:, 0], RATE, cutoff), expected[:, 0])


class Plane:
    """A model of one joint with three parameters, none of them of friction with a memory."""

    efforts, displacements = ("roll",), ()

    def regressor(self, motion: ArmMotion) -> Regressor:
        columns = np.column_stack([motion.q, np.sin(motion.dq), np.sign(motion.dq)])
        return Regressor(columns[:, None], np.abs(motion.q[:, 0]) > 0.1)


def test_a_refit_in_blocks_is_that_of_the_whole(monkeypatch):
    rng = np.random.default_rng(1)
    q, dq, ddq = rng.standard_normal((3, N, 1))
    motion = ArmMotion(q, dq, ddq, 1.0 / RATE, np.zeros(N, np.int64))
    along: Any = SimpleNamespace(
        identified=SimpleNamespace(model=lambda fit: Plane()), motion=lambda fit, joint: motion
    )
    tau = Plane().regressor(motion).Phi[:, 0] @ np.array([3.0, -2.0, 0.5]) + 0.1 * rng.standard_normal(N)
    joint: Any = SimpleNamespace(joint="roll", tau=tau, tau_hat=0.5 * tau)
    free, fit = np.arange(N) % 7 > 0, cast("Any", None)
    expected = joint_models.refit_effort(joint, fit, along, free)
    assert np.std(expected - joint.tau_hat) > 0.1
    monkeypatch.setattr(joint_models, "BLOCK_SAMPLES", BLOCK)
    np.testing.assert_allclose(joint_models.refit_effort(joint, fit, along, free), expected, rtol=1e-10, atol=1e-12)


def test_a_part_of_a_long_record_is_lazy_and_has_its_rows(tmp_path: Path, monkeypatch):
    monkeypatch.setattr(store, "BLOCK_SAMPLES", BLOCK)
    t, q, dq, tau = np.random.default_rng(1).standard_normal((4, N))
    record = PeriodResidual("log", "joint", t=t, q_noise=q, dq_noise=dq, tau_noise=tau)
    with store.Writer(tmp_path, lambda record: lambda template: template, {}) as writer:
        place = writer.write(record)
    later = store.read(PeriodResidual, tmp_path, place, longest=1)
    for rows in (slice(0, N), slice(900, 2100), slice(N - 1, N), slice(BLOCK, 2 * BLOCK)):
        np.testing.assert_array_equal(later.part(rows).tau_noise, tau[rows])
        np.testing.assert_array_equal(later.part(rows).part(slice(1, 5)).t, t[rows][1:5])
        assert len(later.part(rows)) == len(t[rows])
        assert "t" not in vars(later.part(rows))


@pytest.mark.parametrize("step_within", [0.0, 3.0])
def test_steps_of_an_effort_are_found_in_blocks_as_in_the_whole(monkeypatch, step_within: float):
    rng, k = np.random.default_rng(1), np.arange(N)
    residual = 0.1 * rng.standard_normal(N) - 3.0 * (k < 60) + step_within * (k > 2000)
    given = residual, rng.uniform(size=N) > 0.01, np.zeros(N), 10
    expected = beyond_steps(*given)
    assert expected.any() == (step_within == 0.0)
    monkeypatch.setattr(arrays, "BLOCK_SAMPLES", BLOCK)
    np.testing.assert_array_equal(beyond_steps(*given), expected)


def test_a_long_line_is_drawn_by_the_same_samples_in_blocks_as_in_the_whole(monkeypatch):
    t, x = np.cumsum(np.random.default_rng(1).uniform(0.0, 2.0, (2, N)), axis=1)
    expected = envelope(t, np.sin(x), 50)
    monkeypatch.setattr(arrays, "BLOCK_SAMPLES", BLOCK)
    np.testing.assert_array_equal(envelope(t, np.sin(x), 50), expected)


def test_harmonics_of_uneven_samples_are_fitted_in_blocks_as_over_the_whole(monkeypatch):
    rng = np.random.default_rng(1)
    t, x = np.sort(rng.uniform(0.0, 10.0, N)), rng.standard_normal(N)
    monkeypatch.setattr(harmonics, "MAX_BASIS_SAMPLES", BLOCK)
    F = harmonics.basis(t, 2.0, 4)
    c, residual = harmonics.Harmonics(t, 2.0, 4).fit(x)
    np.testing.assert_allclose(c, np.linalg.lstsq(F, x, rcond=None)[0], rtol=0.0, atol=1e-13)
    np.testing.assert_allclose(residual, x - F @ c, rtol=0.0, atol=1e-13)


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="how much memory a process took is Linux's to say")
def test_a_longer_log_takes_little_more_memory_through_all_stages(tmp_path: Path):
    """Of two and of six blocks, whose size is half of what it is."""
    lengths, half = (4, 12), arrays.BLOCK_SAMPLES // 2
    peaks = [peak("run", hour_study(tmp_path / str(n), n, share=0.25), block=half)[0] for n in lengths]
    for minutes in lengths:
        place = store.path(JointModel, ("push", "hand_roll"))
        model = store.read(JointModel, tmp_path / str(minutes) / "processed" / "lab", place, longest=1)
        assert len(model) == minutes * 60_000
    assert (peaks[1] - peaks[0]) * 2**20 / 480_000 < BYTES
