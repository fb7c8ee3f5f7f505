"""What sections compute and decide, on small records whose answer is known."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from davinci_forces.records import (
    Average,
    FrictionMap,
    PeriodResidual,
    Pose,
    Residual,
    Signal,
    Stiffness,
    Track,
    Whiteness,
)
from davinci_forces.report.sections.innovations import over_time
from davinci_forces.report.sections.joints.details import friction_curves, friction_in_words
from davinci_forces.report.sections.joints.residuals import in_words, motion_panel
from davinci_forces.report.sections.noise import by_period, histogram, outliers
from davinci_forces.report.sections.parts import autocorrelation, normal_plot
from davinci_forces.report.sections.robot import links_in_space
from davinci_forces.report.sections.tissue import spread, spread_panel, surface_map
from tests.report.report_records import record


def test_every_link_is_drawn_from_the_frame_that_carries_it_and_over_no_gap():
    """Two jaws on one head."""
    parent = {"0": "", "1": "0", "2": "1", "left": "2", "tip": "left", "right": "2"}
    names, x = [*parent], np.arange(6.0)
    pose = record(Pose, 6, link=np.array(names, object), parent=np.array([*parent.values()], object), x=x)
    start, end, gap = links_in_space(pose).reshape(-1, 3, 3).transpose(1, 0, 2)
    assert {(names[int(a)], names[int(b)]) for a, b in zip(start[:, 0], end[:, 0], strict=True)} == {
        (carrier, name) for name, carrier in parent.items() if carrier
    }
    assert np.isnan(gap).all()


def residual(errors, dq) -> Residual:
    return record(Residual, len(dq), model="independent", estimator="lse", dq=dq, tau=errors)


def test_an_error_around_reversals_is_told_by_its_ratio_to_the_error_elsewhere():
    dq = np.repeat([1.0, -1.0, 0.05, -0.05, 0.2], [40, 40, 5, 5, 10])
    errors = np.where(np.abs(dq) < 0.1, 3.0, 1.0) * np.tile([1.0, -1.0], 50)
    assert "residual's RMS is 3.0 times its RMS elsewhere" in in_words(residual(errors, dq), errors, None)
    for x, motion in ((errors, np.ones(100)), (np.zeros(100), dq)):  # without a reversal, or an error
        assert "Around reversals" not in in_words(residual(x, motion), x, None)


@pytest.mark.parametrize(("ratio", "remarked"), [(1.5, False), (2.5, True)])
def test_reversals_are_remarked_on_where_the_error_is_more_than_twice_as_large_there(ratio, remarked):
    dq = np.sin(2 * np.pi * np.arange(20000) / 20000)
    slow = np.abs(dq) < 0.1 * np.sqrt(0.5)
    errors = np.where(slow, ratio, 1.0) * np.random.default_rng(0).choice([-1.0, 1.0], len(dq))
    said = in_words(residual(errors, dq), errors, None)
    assert ("Around reversals" in said) == remarked
    assert not remarked or f"{ratio:.1f} times" in said


@pytest.mark.parametrize(("share", "follows"), [(0.05, False), (0.2, True)])
def test_a_residual_follows_the_velocity_where_a_tenth_of_its_variance_does(share, follows):
    rng = np.random.default_rng(1)
    dq = rng.uniform(-1.0, 1.0, 20000)
    errors = np.sqrt(share) * np.sign(dq) + np.sqrt(1.0 - share) * rng.standard_normal(len(dq))
    assert ("So the residual follows the velocity" in in_words(residual(errors, dq), errors, None)) == follows


def test_the_mean_of_each_direction_reaches_to_its_largest_velocity():
    dq, errors = np.array([-2.0, -1.0, 0.0, 1.0, 3.0]), np.array([1.0, 3.0, 9.0, -1.0, -3.0])
    _, backwards, forwards = motion_panel(residual(errors, dq), errors, dq, "velocity", True).marks
    assert_allclose([backwards.x, backwards.y], [[0.0, -2.0], [2.0, 2.0]])
    assert_allclose([forwards.x, forwards.y], [[0.0, 3.0], [-2.0, -2.0]])
    _, only = motion_panel(
        residual(np.ones(2), np.array([1.0, 2.0])), np.ones(2), np.array([1.0, 2.0]), "v", True
    ).marks
    assert only.y[0] == 1.0


def friction(model: str) -> FrictionMap:
    dq = np.array([-2.0, -1.0, 1.0, 2.0] * 2)
    columns = {"dq": dq, "tau_friction": 2.0 * np.sign(dq) + dq, "tau_friction_hat": np.sign(dq)}
    return record(FrictionMap, 8, model=model, gaining=np.repeat([1, 0], 4), **columns)


@pytest.mark.parametrize(("model", "lines"), [("independent", 2), ("chosen", 4)])
def test_friction_has_a_curve_a_direction_and_one_of_each_branch_where_it_has_a_memory(model, lines):
    drawn = [*friction_curves(friction(model))]
    assert len(drawn) == lines
    assert [bool(line.label) for line in drawn] == [True] + [False] * (lines - 1)
    assert all(np.all(np.sign(line.x) == np.sign(line.x[0])) and np.all(np.diff(line.x) >= 0) for line in drawn)
    assert friction_in_words(friction(model)) == "−3.5 on average backwards and 3.5 forwards."


@pytest.mark.parametrize("model", ["independent", "chosen"])
def test_the_legend_names_the_model_s_friction_where_no_sample_gains_speed_or_one_is_at_rest(model):
    for changed in ({"gaining": np.zeros(8, int)}, {"dq": np.r_[0.0, friction(model).dq[1:]]}):
        drawn = [*friction_curves(replace(friction(model), **changed))]
        assert [bool(line.label) for line in drawn] == [True] + [False] * (len(drawn) - 1)


def test_an_innovation_is_drawn_from_its_second_second_on_wherever_the_log_starts():
    t = 100.0 + np.arange(600) / 100.0
    [line] = over_time(record(Track, 600, t=t, innovation_q=t), "innovation_q", "position").marks
    assert line.x[0] == pytest.approx(101.0)
    short = record(Track, 400, t=t[:400], innovation_q=t[:400])
    left = len(over_time(short, "innovation_q", "position").marks[0].x)
    assert left == 280  # of less than 5 s, a fifth and a tenth are left out


def test_a_histogram_holds_all_samples_beside_the_density_of_a_normal_distribution():
    x = 2.0 + 0.5 * np.random.default_rng(0).standard_normal(5000)
    edges, densities, grid, normal = histogram(x)
    assert np.sum(densities * np.diff(edges)) == pytest.approx(1.0)
    assert np.trapezoid(normal, grid) == pytest.approx(1.0, abs=2e-3)
    assert grid[np.argmax(normal)] == pytest.approx(2.0, abs=0.05)
    assert normal.max() == pytest.approx(1.0 / (0.5 * np.sqrt(2 * np.pi)), rel=0.05)
    assert np.isfinite(histogram(np.ones(10))[3]).all()


@pytest.mark.parametrize(("velocity", "remarked"), [("logged", True), ("derived", False)])
def test_a_period_is_not_blamed_for_a_derived_velocity_which_errs_at_the_end_of_a_log(velocity, remarked):
    t = np.arange(500) / 100.0
    noise = np.where(t < 4.95, 0.1, 5.0)
    records = {
        PeriodResidual: record(
            PeriodResidual, 500, t=t, q_noise=0.0 * t + 1.0, dq_noise=noise, tau_noise=0.0 * t + 1.0
        ),
        Signal: record(Signal, 500, velocity=velocity),
    }
    context = SimpleNamespace(catalogue=SimpleNamespace(select=lambda kind, **_: [records[kind]]))
    verdicts = list(outliers(context, record(Average, 100, period=1.0, periods=5)))
    assert bool(verdicts) == remarked
    assert not remarked or "velocity noise of period 5 of 5" in verdicts[0].text


def test_the_noise_of_each_period_is_of_its_own_samples():
    t = 2.0 + np.arange(450) / 100.0
    residual = record(PeriodResidual, 450, t=t)
    average = record(Average, 100, t_start=2.0, period=1.0, periods=4)
    noise = np.minimum((t - 2.0 + 1e-9).astype(int) + 1.0, 4.0)  # what is left after the last period belongs to it
    assert_allclose(by_period(residual, average, noise), [1, 2, 3, 4])
    few = record(PeriodResidual, 3, t=np.array([2.1, 2.2, 3.5]))  # no sample in two periods, and one in another
    assert_allclose(by_period(few, average, np.full(3, 5.0)), [5, 5, 0, 0])


def test_a_normal_sample_lies_on_the_line_of_its_plot_whose_slope_is_the_standard_deviation():
    from scipy.stats import norm

    x = 3.0 + 2.0 * norm.ppf((np.arange(1, 2001) - 0.375) / 2000.25)
    points, line = normal_plot("", np.random.default_rng(0).permutation(x), "").marks
    assert (line.slope, line.intercept) == (pytest.approx(2.0, rel=2e-3), pytest.approx(3.0, abs=1e-6))
    assert_allclose(points.y, 3.0 + 2.0 * points.x, atol=1e-9)


@pytest.mark.parametrize(("largest", "smallest"), [(0.05, -0.05), (0.5, -0.02), (1.0, -0.9)])
def test_a_plot_of_an_autocorrelation_shows_all_of_it_and_both_sides_of_zero(largest, smallest):
    acf = np.array([1.0, largest, smallest])
    w = record(Whiteness, 3, lag=np.arange(3), acf=acf, band=0.02, band_99=0.026)
    low, high = autocorrelation(w, "").y_range
    assert low < smallest < 0 < largest <= high
    assert low <= -0.08 < 0.08 <= high  # four bands, so that the band is seen to be one
    stems = autocorrelation(w, "").marks[-1]
    assert_allclose([stems.x, stems.y], [[1, 2], [largest, smallest]])


def places(pushes: int = 8, **columns) -> Stiffness:
    grid = {"x": 0.01 * np.arange(pushes), "y": np.zeros(pushes), "z": 0.002 * (np.arange(pushes) % 4)}
    return record(Stiffness, pushes, log="run", k_t=100.0 * (1 + np.arange(pushes)), **{**grid, **columns})


def test_a_map_of_tissue_is_drawn_over_the_two_axes_along_which_it_was_pushed():
    assert spread(places()) == pytest.approx(0.006)
    assert spread(places(y=np.full(8, np.nan))) == pytest.approx(0.006)  # an axis that is not known is none
    assert spread(places(3)) == 0.0
    [panel] = surface_map(places()).panels
    assert (panel.x_label, panel.y_label) == ("x [mm]", "z [mm]")
    assert [len(points.x) for points in panel.marks] == [2, 2, 2, 2]  # quarters of the pushes
    assert_allclose(np.concatenate([points.x for points in panel.marks]), 10.0 * np.arange(8))
    assert panel.marks[0].label == "100 to 275 N/m"


def test_pushes_that_do_not_count_are_in_no_histogram():
    counted = np.array([1, 1, 0, 1, 0, 1, 1, 1])
    quartiles, bars = spread_panel(places(counted=counted, stiffness_q1=200.0, stiffness_q3=400.0)).marks
    assert (quartiles.start, quartiles.end) == (200.0, 400.0)
    assert bars.counts.sum() == counted.sum()
