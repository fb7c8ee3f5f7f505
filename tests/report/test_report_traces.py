"""Thinning: nothing that stands out may be lost, and nothing may be more than the page can carry."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from report_documents import zoomable

from davinci_forces.report.content import MAX_POINTS_OF_MARK, Figure, Panel
from davinci_forces.report.content.marks import Band, Line, Points
from davinci_forces.report.content.thinning import envelope, thin_mark
from davinci_forces.report.writers.numbers import thin_figure, thinning_note


@given(st.integers(0, 2**31), st.integers(2, 3000), st.integers(1, 200))
def test_the_envelope_keeps_the_extremes_of_every_range_of_x(seed: int, samples: int, bins: int) -> None:
    rng = np.random.default_rng(seed)
    x = np.sort(rng.uniform(0, 10, samples))
    y = np.where(rng.random(samples) < 0.1, np.nan, rng.standard_normal(samples))
    kept = envelope(x, y, bins)
    assert len(kept) <= 2 * bins
    assert np.all(np.diff(kept) > 0)
    ranges = np.minimum(((x - x[0]) / (x[-1] - x[0]) * bins).astype(int), bins - 1)
    for one in np.unique(ranges):
        inside, shown = y[ranges == one], y[kept][ranges[kept] == one]
        if np.isfinite(inside).any():
            assert (np.nanmin(shown), np.nanmax(shown)) == (np.nanmin(inside), np.nanmax(inside))
        else:
            assert np.isnan(shown).all()
            assert len(shown)


def test_one_sample_that_stands_out_survives_among_a_million() -> None:
    y = np.zeros(1_000_000)
    y[654_321] = -7.0
    line = thin_mark(Line(np.arange(1e6), y), 1000)
    assert isinstance(line, Line)
    assert len(line.x) <= 1000
    assert line.x[line.y == -7.0] == [654_321.0]


def test_a_thinned_band_covers_the_band() -> None:
    x = np.linspace(0, 1, 10_000)
    y = np.sin(300 * x)
    band = thin_mark(Band(x, y - 1, y + 1), 400)
    assert isinstance(band, Band)
    assert 2 * len(band.x) <= 400
    place = np.searchsorted(band.x, x, side="right") - 1
    assert np.all(band.lower[place] <= y - 1)
    assert np.all(band.upper[place] >= y + 1)


def test_points_off_the_order_of_x_are_taken_at_even_steps_with_their_deviations() -> None:
    x = np.sin(np.arange(1000.0))
    points = thin_mark(Points(x, x, y_std=np.abs(x)), 100)
    assert isinstance(points, Points)
    assert points.y_std is not None
    np.testing.assert_array_equal(points.x, x[::10])
    np.testing.assert_array_equal(points.y_std, np.abs(x[::10]))


@pytest.mark.parametrize("samples", [100, 4_998, 5_000, 60_000])
def test_a_figure_keeps_to_its_limit_and_says_what_it_shows(samples: int) -> None:
    figure = zoomable(samples, "z")
    result = thin_figure(figure, 20_000)
    note = thinning_note(figure.samples, result.samples)
    drawn = sum(
        len(mark.x) * (2 if isinstance(mark, Band) else 1)
        for panel in result.panels
        for mark in panel.marks
        if hasattr(mark, "x") and isinstance(mark.x, np.ndarray)
    )
    assert drawn == result.samples <= 20_000
    assert figure.samples == 4 * samples + 4
    assert ("All" in note) == (figure.samples <= 20_000)
    assert ("envelope" in note) == (figure.samples > 20_000)


def test_a_figure_holds_so_many_points_of_a_long_mark_and_knows_how_many_there_were() -> None:
    t = np.arange(1e6)
    y = np.sin(t)
    y[654_321] = 7.0
    short = Points(t[:10], y[:10])
    figure = Figure("", "", (Panel("", "", "", (Line(t, y), Band(t, y - 1, y + 1), short)),))
    line, band, points = figure.panels[0].marks
    assert isinstance(line, Line)
    assert isinstance(band, Band)
    assert 0.9 * MAX_POINTS_OF_MARK < len(line.x) <= MAX_POINTS_OF_MARK
    assert 0.9 * MAX_POINTS_OF_MARK < 2 * len(band.x) <= MAX_POINTS_OF_MARK
    assert points is short
    assert line.x[line.y == 7.0] == [654_321.0]
    result = thin_figure(figure, 1000)
    assert figure.samples == 3_000_010
    assert result.samples <= 1000
    note = thinning_note(figure.samples, result.samples)
    assert "3\N{NARROW NO-BREAK SPACE}000\N{NARROW NO-BREAK SPACE}010 of all curves" in note


def test_short_marks_stay_whole_beside_long_ones() -> None:
    short, long = Line(np.arange(50.0), np.arange(50.0)), Line(np.arange(9000.0), np.arange(9000.0))
    result = thin_figure(Figure("", "", (Panel("", "", "", (long, short)),)), 1000)
    first, second = result.panels[0].marks
    assert second.x is not None
    assert len(second.x) == 50  # type: ignore[union-attr]
    assert 900 <= len(first.x) <= 950  # type: ignore[union-attr]


def test_columns_of_different_lengths_are_refused() -> None:
    with pytest.raises(ValueError, match="one length"):
        Line(np.arange(3.0), np.arange(4.0))
