"""When samples were taken: each write, channel and group of a file on the clock that it says, in TDMS and LVM."""

import io
from collections.abc import Mapping, Sequence
from dataclasses import replace
from datetime import datetime, timedelta
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from nptdms import ChannelObject, TdmsFile, TdmsWriter
from numpy.testing import assert_allclose, assert_array_equal

from davinci_forces.errors import BadLog
from davinci_forces.logs.timeline import ROUNDING, Timeline
from tests.logs.lvm_writer import Style, Write, lvm
from tests.logs.reading import read, times_of

NOON = datetime(2026, 10, 15, 12)
WORDS = ("wf_start_time", "wf_start_offset", "wf_increment")
Said = dict[str, float]  # wf_start_time [s] since noon, wf_start_offset [s], wf_increment [s]


def properties(said: Said) -> dict[str, Any]:
    """What a write says, as npTDMS writes it."""
    start = {"wf_start_time": NOON + timedelta(seconds=said["wf_start_time"])} if "wf_start_time" in said else {}
    return {**said, **start}


def tdms(*writes: Mapping[str, tuple[Sequence[float], Said]]) -> bytes:
    """A file of writes: for every channel its samples, and what is said of its clock anew."""
    file = io.BytesIO()
    with TdmsWriter(file) as writer:
        for write in writes:
            writer.write_segment([
                ChannelObject(*name.split("/"), np.array(samples, dtype=float), properties(said))
                for name, (samples, said) in write.items()
            ])  # fmt: skip
    return file.getvalue()


def said(start: float, step: float, offset: float = 0.0) -> Said:
    return dict(zip(WORDS, (start, offset, step), strict=True))


def test_a_pause_between_two_writes_of_a_tdms_file_is_kept() -> None:
    log, samples = read(tdms({"a/q": ([1, 2], said(0, 0.01))}, {"a/q": ([3, 4], said(60, 0.01))}), "log.tdms")
    assert_allclose(times_of(log, "a/q", samples), [0, 0.01, 60, 60.01], rtol=1e-12)
    assert_array_equal(samples["a/q"], [1, 2, 3, 4])
    assert "'time' begins anew at sample 2" in log.warnings[0]


def test_a_write_that_follows_directly_goes_on_to_the_last_bit() -> None:
    step = 1 / 3000
    follows = round(1000 * step, 6)  # as a start in whole microseconds says it
    log, _ = read(tdms({"a/q": (range(1000), said(0, step))}, {"a/q": (range(1000), said(follows, step))}), "log.tdms")
    assert log.clock is not None
    assert (log.clock.start, log.clock.step, log.time) == (0.0, step, "")


def test_properties_that_are_said_again_alike_change_nothing() -> None:
    log, _ = read(tdms(*[{"a/q": ([1, 2], said(0, 0.01, 0.5))}] * 3), "log.tdms")
    assert log.clock is not None
    assert (log.clock.start, log.clock.step) == (0.5, 0.01)


def test_an_interval_that_changes_goes_on_from_where_the_samples_are() -> None:
    log, samples = read(tdms({"a/q": ([1, 2], said(0, 0.01))}, {"a/q": ([3, 4], {"wf_increment": 0.1})}), "log.tdms")
    assert_allclose(times_of(log, "a/q", samples), [0, 0.01, 0.02, 0.12], rtol=1e-12)


def test_properties_written_behind_all_samples_hold_for_them() -> None:
    log, _ = read(tdms({"a/q": ([1, 2], {})}, {"a/q": ([], said(0, 0.02))}), "log.tdms")
    assert log.clock is not None
    assert log.clock.step == 0.02


def test_a_start_offset_of_one_channel_shifts_it_alone() -> None:
    log, samples = read(tdms({"a/q": ([1, 2], said(0, 0.01)), "a/i": ([3, 4], said(0, 0.01, 0.5))}), "log.tdms")
    assert_allclose(times_of(log, "a/q", samples), [0, 0.01], rtol=1e-12)
    assert_allclose(times_of(log, "a/i", samples), [0.5, 0.51], rtol=1e-12)
    assert log.find("a/i").time == "time of a/i"


def test_channels_that_are_described_anew_are_grouped_by_their_new_clocks() -> None:
    log, _ = read(tdms({"a/q": ([1, 2], said(0, 0.01)), "a/i": ([3, 4], said(0, 0.01, 0.5))}), "log.tdms")
    assert log.by_clock(["a/q", "a/i"]) == {"": ["a/q"], "time of a/i": ["a/i"]}
    log.channels = tuple(replace(channel, time="") for channel in log.channels)
    assert log.by_clock(["a/q", "a/i"]) == {"": ["a/q", "a/i"]}


def test_channels_that_began_a_fiftieth_of_a_sample_apart_have_one_clock() -> None:
    for apart, clocks in ((14e-6, 1), (30e-6, 2)):
        log, samples = read(tdms({"a/q": ([1, 2], said(0, 1e-3)), "a/i": ([3, 4], said(apart, 1e-3))}), "log.tdms")
        assert len(log.by_clock(list(samples))) == clocks


def test_two_groups_with_time_stamps_each_have_a_clock_each() -> None:
    noon = np.datetime64(NOON, "us")
    stamps = {"a": noon + np.array([0, 10_000, 20_000]), "b": noon + np.array([5_000, 2_000_000])}
    file = io.BytesIO()
    with TdmsWriter(file) as writer:
        for group, times in stamps.items():
            values = np.arange(float(len(times)))
            writer.write_segment([ChannelObject(group, "t", times), ChannelObject(group, "x", values)])
    log, samples = read(file.getvalue(), "log.tdms")
    assert_allclose(times_of(log, "a/x", samples), [0, 0.01, 0.02], atol=1e-12)
    assert_allclose(times_of(log, "b/x", samples), [0.005, 2.0], atol=1e-12)
    assert_array_equal(samples["b/x"], [0, 1])


def test_a_channel_that_nothing_is_said_of_has_no_clock_of_another_that_has_more_samples() -> None:
    log, _ = read(tdms({"a/q": ([1, 2, 3], said(0, 0.01)), "b/x": ([4, 5], {})}), "log.tdms")
    assert (log.clock, log.time, log.find("b/x").time) == (None, "", "")
    assert log.find("a/q").time == "time of a/q"
    log, _ = read(tdms({"a/q": ([1, 2], said(0, 0.01)), "b/x": ([4, 5], {})}), "log.tdms")
    assert log.clock is not None


def test_channels_of_several_clocks_are_not_served_at_once() -> None:
    log, _ = read(tdms({"a/q": ([1, 2], said(0, 0.01)), "a/i": ([3, 4], said(0, 0.02))}), "log.tdms")
    with pytest.raises(BadLog, match="'a/q', 'a/i' have 2 clocks; read them one by one"):
        next(log.blocks(["a/q", "a/i"]))


@pytest.mark.parametrize(("word", "values"), [("unit_string", ("mA", "A")), ("NI_Scale[0]_Linear_Slope", (1.0, 2.0))])
def test_samples_before_and_after_another_unit_or_scale_are_not_mixed(word: str, values: tuple[Any, Any]) -> None:
    file = io.BytesIO()
    with TdmsWriter(file) as writer:
        for value in values:
            writer.write_segment([ChannelObject("a", "q", np.arange(2.0), {word: value})])
    with pytest.raises(BadLog, match="in a later file segment, so its samples mean two things"):
        read(file.getvalue(), "log.tdms")


@st.composite
def histories(draw: Any) -> list[dict[str, tuple[list[float], Said]]]:
    """Writes of some channels, each of which says some of its clock anew."""
    writes: list[dict[str, tuple[list[float], Said]]] = []
    known: set[str] = set()
    value = (
        st.sampled_from((0.0, 0.25, 1.0, 3.0, 60.0)),
        st.sampled_from((0.0, 0.125)),
        st.sampled_from((0.01, 0.02, 0.5)),
    )
    for _ in range(draw(st.integers(1, 5))):
        names = draw(st.lists(st.sampled_from(("a/q", "a/i", "b/f")), min_size=1, unique=True))
        write = {}
        for name in names:
            anew = WORDS if name not in known else draw(st.lists(st.sampled_from(WORDS), unique=True))
            clock = {word: draw(value[WORDS.index(word)]) for word in anew}
            many = draw(st.integers(1, 4))
            write[name] = ([float(len(writes))] * many, clock)
            known.add(name)
        writes.append(write)
    return writes


def witness(writes: Sequence[Mapping[str, tuple[Sequence[float], Said]]], name: str) -> list[float]:
    """The times of a channel [s] since noon, sample by sample, by the words of the format's specification."""
    clock: Said = {}
    times: list[float] = []
    step = 0.0  # from the sample before
    for write in writes:
        samples, anew = write.get(name, ((), {}))
        before, clock = clock, {**clock, **anew}
        for i in range(len(samples)):
            begins = i == 0 and any(before.get(word) != clock[word] for word in WORDS[:2])
            times.append(clock[WORDS[0]] + clock[WORDS[1]] if begins else times[-1] + step)
            step = clock[WORDS[2]]
    return times


@given(histories())
@settings(max_examples=200)
def test_any_history_of_writes_has_the_samples_of_nptdms_and_the_times_of_a_slow_witness(
    writes: list[dict[str, tuple[list[float], Said]]],
) -> None:
    content = tdms(*writes)
    log, samples = read(content, "log.tdms")
    started = (datetime.fromisoformat(log.started) - NOON).total_seconds()
    rival = TdmsFile.read(io.BytesIO(content))
    for name in {name for write in writes for name in write}:
        wanted = witness(writes, name)
        assert_array_equal(samples[name][: len(wanted)], rival[name.split("/")[0]][name.split("/")[1]][:])
        assert np.isnan(samples[name][len(wanted) :]).all()
        times = times_of(log, name, samples)[: len(wanted)]
        assert_allclose(times + started, wanted, rtol=0, atol=ROUNDING + 1e-9)


@given(
    st.lists(
        st.tuples(st.integers(1, 5), st.one_of(st.none(), st.floats(0, 9)), st.sampled_from((0.1, 0.3))), min_size=1
    )
)
def test_the_times_of_a_timeline_do_not_depend_on_how_it_is_asked(
    writes: list[tuple[int, float | None, float]],
) -> None:
    timeline = Timeline()
    for write in writes:
        timeline.add(*write)
    whole = timeline.times(0, timeline.rows)
    assert_array_equal(whole, np.concatenate([timeline.times(row, 1) for row in range(timeline.rows)]))


def test_lvm_columns_of_x_that_differ_are_the_clocks_of_their_channels() -> None:
    x = [0.0, 0.1, 0.2, 0.3]
    y: list[float | None] = [0.05, 0.25, None, None]
    columns = {"q": [1.0, 2.0, 3.0, 4.0], "i": [5.0, 6.0, None, None], "f": [7.0, 8.0, 9.0, 10.0]}
    log, samples = read(lvm([Write(columns, xs=[x, y, x])], Style(x_columns="Multi")))
    assert_array_equal(times_of(log, "q", samples), x)
    assert_array_equal(times_of(log, "f", samples), x)
    assert_array_equal(times_of(log, "i", samples), [0.05, 0.25])
    assert_array_equal(samples["i"], [5, 6])
    assert (log.time, log.nulls["i"]) == ("X_Value", 0)


def test_lvm_columns_of_x_that_are_the_same_are_one_clock() -> None:
    x = [0.0, 0.1, 0.2]
    log, samples = read(lvm([Write({"q": [1.0, 2, 3], "i": [4.0, 5, 6]}, xs=[x, x])], Style(x_columns="Multi")))
    assert list(log.by_clock(list(samples))) == [""]


def test_lvm_channels_without_x_have_the_start_and_interval_of_their_headers() -> None:
    columns = {"q": [1.0, 2.0, 3.0, 4.0], "i": [5.0, 6.0, None, None]}
    write = Write(
        columns, steps=(0.1, 0.2), x0s=(0.0, 0.05), starts=("02:26:06,5", "02:26:07,5"), samples=4
    )  # fmt: skip
    log, samples = read(lvm([write], Style(x_columns="No")))
    assert log.clock is not None
    assert (log.clock.start, log.clock.step) == (0.0, 0.1)
    assert_allclose(times_of(log, "i", samples), [1.05, 1.25], rtol=1e-12)
    assert_array_equal(samples["i"], [5, 6])


def test_lvm_channels_with_an_interval_of_their_own_beside_one_column_of_x_do_not_have_that_x() -> None:
    columns = {"q": [1.0, 2.0, 3.0, 4.0], "i": [5.0, 6.0, None, None]}
    log, samples = read(lvm([Write(columns, x=[0.0, 0.1, 0.2, 0.3], steps=(0.1, 0.2))]))
    assert_allclose(times_of(log, "q", samples), [0, 0.1, 0.2, 0.3])
    assert_allclose(times_of(log, "i", samples), [0, 0.2])
    # Where the first is the slower one, rows go on after its last sample.
    log, samples = read(lvm([Write(dict(reversed(columns.items())), x=[0.0, 0.2, 0.4, 0.6], steps=(0.2, 0.1))]))
    assert_allclose(times_of(log, "i", samples), [0, 0.2])
    assert_allclose(times_of(log, "q", samples), [0, 0.1, 0.2, 0.3])
    assert log.nulls["i"] == 0


def test_lvm_clocks_are_right_from_one_dated_write_to_the_next() -> None:
    def write(start: str, steps: tuple[float, float]) -> Write:
        return Write({"q": [1.0, 2.0], "i": [3.0, 4.0]}, start=start, steps=steps)

    log, samples = read(lvm([write("02:26:06,5", (0.1, 0.2)), write("02:27:06,5", (0.1, 0.5))], Style(x_columns="No")))
    assert_allclose(times_of(log, "q", samples), [0, 0.1, 60, 60.1], rtol=1e-12)
    assert_allclose(times_of(log, "i", samples), [0, 0.2, 60, 60.5], rtol=1e-12)


def test_lvm_columns_of_x_are_right_from_one_dated_write_to_the_next() -> None:
    xs = [[0.0, 0.1], [0.05, 0.25]]
    writes = [Write({"q": [1.0, 2.0], "i": [3.0, 4.0]}, xs=xs, start=start) for start in ("02:26:06,5", "02:27:06,5")]
    log, samples = read(lvm(writes, Style(x_columns="Multi")))
    assert_allclose(times_of(log, "q", samples), [0, 0.1, 60, 60.1], rtol=1e-12)
    assert_allclose(times_of(log, "i", samples), [0.05, 0.25, 60.05, 60.25], rtol=1e-12)
