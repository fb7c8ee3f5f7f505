"""What `inspect` says of a log."""

import json
from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import typer
from hypothesis import given
from hypothesis import strategies as st
from nptdms import ChannelObject, TdmsWriter
from numpy.testing import assert_allclose
from typer.testing import CliRunner

from davinci_forces.commands import inspect
from davinci_forces.maths.signals.columns import Outline
from tests.logs.lvm_writer import Style, Write, lvm
from tests.logs.test_clocks import NOON, said, tdms


def shown(path: Path, *options: str) -> str:
    app = typer.Typer()
    app.command()(inspect.run)
    done = CliRunner().invoke(app, [str(path), *options], catch_exceptions=False)
    assert done.exit_code == 0
    return done.output


@pytest.fixture
def log(tmp_path: Path) -> Path:
    path = tmp_path / "log.lvm"
    columns = {"<script>": [1.0, 2.0, np.nan, 4.0], "Roll [rad]": [0.5, None, 0.25, 0.125]}
    path.write_bytes(lvm([Write(columns, x=[0.0, 0.01, 0.02, 0.03], comment="grasped", units=("A", "rad"))]))
    return path


def test_it_shows_channels_units_clock_comments_and_first_rows(log: Path) -> None:
    text = shown(log, "--head", "2")
    assert "log.lvm: lvm, 4 rows, started 2026-10-15T02:26:06.304349 (local time)" in text
    assert "0.03 s at 100 Hz" in text
    assert "1  <script>    A    1 .. 4        ▁▃ █  1 nans" in text
    assert "2  Roll [rad]  rad  0.125 .. 0.5  █ ▃▁  1 nulls" in text
    assert "line 24: grasped" in text
    assert text.partition("first rows:")[2].partition("comments:")[0].count("\n") == 4


def test_json_holds_the_same_and_no_nan(log: Path) -> None:
    found = json.loads(shown(log, "--json"), parse_constant=lambda word: pytest.fail(word))
    assert [channel["unit"] for channel in found["channels"]] == ["s", "A", "rad"]
    assert found["head"]["<script>"] == [1, 2, None, 4]
    assert_allclose(found["clock"]["rate"], 100)
    assert (found["channels"][1]["nans"], found["channels"][2]["nulls"]) == (1, 1)


def test_the_clock_is_in_seconds_whatever_unit_the_name_of_its_channel_states(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    path.write_text("time_ms,q\n" + "".join(f"{1000 + 4 * k},{k % 7}\n" for k in range(101)))
    found = json.loads(shown(path, "--json"))
    assert_allclose([found["clock"][key] for key in ("rate", "duration", "longest_gap")], [250.0, 0.4, 0.004])
    assert found["channels"][0]["most"] == 1400.0


def test_repeated_rows_are_flagged_from_a_tenth_on(tmp_path: Path) -> None:
    t = np.arange(100) * 0.01
    q = np.arange(100.0)
    for repeated, flagged in ((9, False), (15, True)):
        q[1 : 2 * repeated : 2] = q[0 : 2 * repeated : 2]
        path = tmp_path / f"{repeated}.csv"
        path.write_text("t,q\n" + "".join(f"{a!r},{b!r}\n" for a, b in zip(t.tolist(), q.tolist(), strict=True)))
        found = json.loads(shown(path, "--json"))
        assert found["clock"]["duplicates"] == repeated
        assert any("repeat the one before" in warning for warning in found["warnings"]) is flagged


def test_a_jittery_clock_and_a_gap_are_flagged_and_an_even_one_is_not(tmp_path: Path) -> None:
    rng = np.random.default_rng(6)
    even = np.arange(500) * 0.01
    jittery = even + rng.uniform(0, 0.005, 500)
    gapped = np.where(even > 2, even + 0.1, even)
    longest = "the longest time between samples is 0.11 s"
    for name, t, words in (("even", even, ""), ("jittery", jittery, "varies by"), ("gapped", gapped, longest)):
        path = tmp_path / f"{name}.csv"
        path.write_text("t,q\n" + "".join(f"{a:.6f},{b}\n" for b, a in enumerate(t.tolist())))
        warnings = json.loads(shown(path, "--json"))["warnings"]
        assert any(words in warning for warning in warnings) if words else not warnings


def test_a_log_without_a_clock_says_what_may_be_one(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    path.write_text("".join(f"{0.5 * i + 7},{(-1) ** i}\n" for i in range(20)))
    text = shown(path)
    assert "unless study.toml names a channel of times, add rate = ... [Hz] there" in text
    assert "or time = 'column_0', which increases throughout (2 Hz" in text


def test_an_lvm_log_whose_x_restarts_says_how_to_go_on(tmp_path: Path) -> None:
    path = tmp_path / "log.lvm"
    path.write_bytes(lvm([Write({"a": [1.0, 2.0]}, x=[0.0, 0.01])] * 3, Style(several=False)))
    text = shown(path)
    assert "time 'X_Value' goes back 2 times and repeats 0 times, first in row 3" in text
    assert "  0.01 s from the first to the last sample; between interruptions at 100 Hz, jitter" in text


def test_the_zero_of_labview_is_no_start(tmp_path: Path) -> None:
    epoch = (datetime(1904, 1, 1) - NOON).total_seconds()
    path = tmp_path / "log.tdms"
    path.write_bytes(tdms({"a/q": ([1, 2], said(epoch, 0.01))}))
    assert "2 rows, start unknown: the file has LabVIEW's zero, 1904-01-01" in shown(path)


@given(st.lists(st.floats(-1e3, 1e3) | st.just(np.nan), min_size=20), st.lists(st.floats(0, 1), min_size=1))
def test_an_outline_does_not_depend_on_the_blocks(values: list[float], cuts: list[float]) -> None:
    whole, parts = Outline(width=4), Outline(width=4)
    array = np.array(values, dtype=float)
    whole.update(array)
    for part in np.split(array, sorted(round(cut * len(values)) for cut in cuts)):
        parts.update(part)
    good = array[np.isfinite(array)]
    assert (parts.samples, parts.finite) == (len(array), len(good))
    assert_allclose(parts.course, whole.course, atol=1e-9, equal_nan=True)
    assert len(whole.course) <= 8
    if len(good):
        assert (whole.least, whole.most) == (good.min(), good.max())
        assert_allclose(whole.mean, good.mean(), atol=1e-9)


def test_the_bars_go_from_low_to_high() -> None:
    course: list[Any] = [*range(8), None]
    assert inspect.sparkline(course) == "▁▂▃▄▅▆▇█ "
    assert inspect.sparkline([None]) == ""
    assert inspect.sparkline([2.0, 2.0]) == "▁▁"


def test_every_clock_of_a_log_is_shown(tmp_path: Path) -> None:
    path = tmp_path / "log.tdms"
    path.write_bytes(tdms({"a/q": ([1, 2, 3], said(0, 0.01)), "a/i": ([3, 4], said(0, 0.02))}))
    found = json.loads(shown(path, "--json"))
    assert_allclose([found["clock"]["rate"], found["clocks"][0]["rate"]], [100, 50])
    assert [channel["samples"] for channel in found["channels"]] == [3, 2, 2]
    assert "another clock: channel 'time of a/i', 50 Hz, of 'a/i'" in shown(path)


def test_control_characters_are_written_out(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    path.write_bytes(b"t,q\x1b[31m \xc2\xb0\n0,1\n1,2\n")
    assert "q\\x1b[31m \u00b0" in shown(path)
    assert "\x1b" not in shown(path)


def test_a_log_of_words_alone_is_shown(tmp_path: Path) -> None:
    path = tmp_path / "log.tdms"
    with TdmsWriter(str(path)) as writer:
        writer.write_segment([ChannelObject("a", "words", ["grasp", "let go"])])
    assert "0  a/words  -  text" in shown(path)


@pytest.mark.parametrize("cell", ["", "nan"])
@pytest.mark.parametrize("place", [0, 1, 2])
def test_a_column_without_any_number_is_shown(tmp_path, cell, place):
    rows = [["3" if row % 2 else "1", "5", f"{row % 3}"] for row in range(9)]
    lines = (";".join([*row[:place], cell, *row[place + 1 :]]) for row in rows)
    (tmp_path / "log.csv").write_text("\n".join([*lines, ""]))
    assert f"column_{place}" in shown(tmp_path / "log.csv")
