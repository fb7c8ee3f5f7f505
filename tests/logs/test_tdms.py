"""TDMS files in every layout, read back bit for bit, and cut anywhere."""

import io
from datetime import datetime
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from nptdms import ChannelObject, GroupObject, RootObject, TdmsFile, TdmsWriter
from numpy.testing import assert_allclose, assert_array_equal
from numpy.typing import NDArray

from davinci_forces.errors import BadLog
from davinci_forces.logs import log as asked
from davinci_forces.logs.tdms import samples as tdms_samples
from davinci_forces.logs.tdms import walk as tdms_walk
from tests.logs.cutting import is_cut_honestly
from tests.logs.reading import read
from tests.logs.tdms_writer import KINDS, daqmx, segment

Table = dict[str, NDArray[Any]]
NAMES = ("Motors/Roll current", "Motors/it's", "Joints/<script>", "Joints/Roll", "a/b/c")


def samples_of(draw: Any, kind: str, rows: int) -> NDArray[Any]:
    """Samples that a float64 holds exactly."""
    if kind.startswith("f"):
        values = st.floats(width=int(kind[1]) * 8, allow_nan=True)
    else:
        limits = np.iinfo(kind)
        values = st.integers(max(int(limits.min), -(2**53)), min(int(limits.max), 2**53))
    return np.array(draw(st.lists(values, min_size=rows, max_size=rows)), dtype=kind)


@st.composite
def tables(draw: Any, rows: int | None = None) -> Table:
    rows = draw(st.integers(1, 12)) if rows is None else rows
    names = draw(st.lists(st.sampled_from(NAMES), min_size=1, max_size=4, unique=True))
    return {name: samples_of(draw, draw(st.sampled_from(sorted(KINDS))), rows) for name in names}


def objects(table: Table) -> list[ChannelObject]:
    return [ChannelObject(*name.split("/", 1), samples) for name, samples in table.items()]


def written(*tables: Table) -> bytes:
    """A segment for each table, by npTDMS."""
    file = io.BytesIO()
    with TdmsWriter(file) as writer:
        for table in tables:
            writer.write_segment(objects(table))
    return file.getvalue()


def holds(content: bytes, wanted: Table) -> None:
    _, samples = read(content, "log.tdms")
    assert set(samples) == set(wanted)
    for name, values in wanted.items():
        assert_array_equal(samples[name], values.astype(np.float64))


def joined(tables: list[Table]) -> Table:
    return {name: np.concatenate([table[name].astype(np.float64) for table in tables]) for name in tables[0]}


@given(tables(), st.integers(1, 4))
@settings(max_examples=60)
def test_what_nptdms_writes_reads_back_bit_for_bit(table: Table, segments: int) -> None:
    holds(written(*[table] * segments), joined([table] * segments))


@given(tables(), st.booleans(), st.sampled_from("<>"), st.integers(1, 5), st.booleans())
@settings(max_examples=100)
def test_any_layout_reads_back_bit_for_bit(
    table: Table, interleaved: bool, order: str, segments: int, described: bool
) -> None:
    content = segment(table, interleaved, order)
    content += segment(table, interleaved, order, described) * (segments - 1)
    holds(content, joined([table] * segments))


@given(st.data(), st.integers(2, 4), st.sampled_from("<>"))
@settings(max_examples=60)
def test_several_chunks_in_a_segment_read_back_in_order(data: st.DataObject, chunks: int, order: str) -> None:
    table = data.draw(tables(rows=chunks * data.draw(st.integers(1, 4))))
    content = segment(table, order=order, chunks=chunks) * 3
    holds(content, joined([table] * 3))


@given(tables(), st.booleans(), st.data())
@settings(max_examples=100)
def test_a_file_cut_at_any_byte_gives_whole_samples_or_a_clear_error(
    table: Table, interleaved: bool, data: st.DataObject
) -> None:
    content = segment(table, interleaved) + segment(table, interleaved, described=False) * 2
    is_cut_honestly(content, data.draw(st.integers(0, len(content))), "log.tdms")


def test_a_million_samples_written_one_by_one_are_read_in_order() -> None:
    one = {"a/x": np.array([1.0]), "a/y": np.array([2], dtype=np.int32)}
    content = segment(one) + segment(one, described=False) * 200_000
    log, samples = read(content, "log.tdms")
    assert log.facts["segments"] == "200001"
    assert_array_equal(samples["a/x"], np.ones(200_001))
    assert_array_equal(samples["a/y"], np.full(200_001, 2.0))


def test_segments_that_change_in_the_middle_of_a_run_are_noticed() -> None:
    def one(value: float) -> Table:
        return {"a/x": np.array([value])}

    content = segment(one(0.0)) + b"".join(segment(one(float(i)), described=False) for i in range(1, 50))
    content += segment({"a/x": np.array([50.0, 51.0])}) + segment({"a/x": np.array([52.0, 53.0])}, described=False)
    content += segment(one(54.0)) + segment(one(55.0))
    holds(content, {"a/x": np.arange(56.0)})


@pytest.mark.parametrize("interleaved", [False, True])
@pytest.mark.parametrize("block", [8, 40, 200, 1000])
def test_blocks_of_any_size_give_the_same_samples(
    monkeypatch: pytest.MonkeyPatch, interleaved: bool, block: int
) -> None:
    table = {"a/x": np.arange(12.0), "a/y": np.arange(12, dtype=np.int16), "b/z": -np.arange(12.0)}
    contents = [segment(table, interleaved) + segment(table, interleaved, described=False) * 5]
    contents += [] if interleaved else [segment(table, chunks=chunks) * 4 for chunks in (2, 12)]
    for module, name, value in (
        (tdms_walk, "BLOCK", block), (tdms_walk, "SMALL_SEGMENT", block), (tdms_samples, "BLOCK", block),
        (tdms_samples, "PIECE_ROWS", 5), (asked, "BLOCK_ROWS", 7),
    ):  # fmt: skip
        monkeypatch.setattr(module, name, value)
    holds(contents[0], joined([table] * 6))
    for content in contents[1:]:
        holds(content, joined([table] * 4))


def test_records_larger_than_a_block_are_read_in_slices() -> None:
    rng = np.random.default_rng(2)
    table = {"a/x": rng.standard_normal(700_000), "a/y": rng.standard_normal(700_000).astype(np.float32)}
    holds(segment(table), table)


def test_channels_of_different_lengths_stand_side_by_side_and_the_shorter_ends_in_nulls() -> None:
    long, short = np.arange(300_000.0), np.arange(10.0)
    log, samples = read(written({"a/long": long, "b/short": short}), "log.tdms")
    assert_array_equal(samples["a/long"], long)
    assert_array_equal(samples["b/short"][:10], short)
    assert np.isnan(samples["b/short"][10:]).all()
    assert log.nulls == {"a/long": 0, "b/short": 299_990}
    assert "different numbers of samples" in log.warnings[0]


def test_nan_in_a_channel_is_counted_apart_from_missing_samples() -> None:
    log, _ = read(written({"a/x": np.array([1.0, np.nan, 3.0]), "a/y": np.array([1.0])}), "log.tdms")
    assert log.nans == {"a/x": 1, "a/y": 0}
    assert log.nulls == {"a/x": 0, "a/y": 2}


def test_waveform_properties_give_the_clock_and_the_start() -> None:
    file = io.BytesIO()
    properties = {"wf_increment": 0.01, "wf_start_offset": 0.5, "wf_start_time": datetime(2026, 10, 15, 2, 26, 3)}
    with TdmsWriter(file) as writer:
        writer.write_segment([ChannelObject("a", "x", np.arange(3.0), {**properties, "unit_string": "mA"})])
    log, _ = read(file.getvalue(), "log.tdms")
    assert log.clock is not None
    assert (log.clock.step, log.clock.start) == (0.01, 0.5)
    assert (log.started, log.zone) == ("2026-10-15T02:26:03", "UTC")
    assert log.channels[0].unit == "mA"


def test_time_stamps_are_seconds_since_the_first() -> None:
    file = io.BytesIO()
    stamps = np.array(
        ["2026-10-15T02:26:03.250", "2026-10-15T02:26:03.260", "2026-10-15T02:26:05"], dtype="datetime64[us]"
    )
    with TdmsWriter(file) as writer:
        writer.write_segment([ChannelObject("a", "time", stamps), ChannelObject("a", "x", np.arange(3.0))])
    log, samples = read(file.getvalue(), "log.tdms")
    assert log.time == "a/time"
    assert (log.started, log.zone) == ("2026-10-15T02:26:03", "UTC")
    assert_allclose(samples["a/time"], [0.25, 0.26, 2.0], atol=1e-12)


def test_time_stamps_that_no_calendar_holds_are_no_start() -> None:
    file = io.BytesIO()
    stamps = np.array(["2026-10-15T02:26:03", "2026-10-15T02:26:04"], dtype="datetime64[us]")
    with TdmsWriter(file) as writer:
        writer.write_segment([ChannelObject("a", "time", stamps)])
    content = bytearray(file.getvalue())
    content[-17] = content[-1] = 0x7F  # the high bytes of the seconds since 1904
    log, _ = read(bytes(content), "log.tdms")
    assert log.started == ""


def test_a_linear_scale_is_applied_and_an_unknown_one_refused() -> None:
    def file(kind: str) -> bytes:
        scale = {
            "NI_Scaling_Status": "unscaled", "NI_Number_Of_Scales": 1, "NI_Scale[0]_Scale_Type": kind,
            "NI_Scale[0]_Linear_Slope": 2.0, "NI_Scale[0]_Linear_Y_Intercept": 1.0,
            "NI_Scale[0]_Linear_Input_Source": 0xFFFFFFFF,
        }  # fmt: skip
        made = io.BytesIO()
        with TdmsWriter(made) as writer:
            raw = ChannelObject("a", "raw", np.array([1, 2, 3], dtype=np.int16), scale)
            writer.write_segment([RootObject(), GroupObject("a"), raw, ChannelObject("a", "x", np.arange(3.0))])
        return made.getvalue()

    _, samples = read(file("Linear"), "log.tdms")
    assert_array_equal(samples["a/raw"], [3, 5, 7])
    assert_array_equal(samples["a/x"], [0, 1, 2])
    with pytest.raises(BadLog, match="a scale of unknown kind: Fourier"):
        read(file("Fourier"), "log.tdms")


def test_text_channels_are_listed_and_cannot_be_read_as_numbers() -> None:
    file = io.BytesIO()
    with TdmsWriter(file) as writer:
        words = ChannelObject("a", "words", ["grasp", "let go"])
        writer.write_segment([words, ChannelObject("a", "x", np.arange(2.0))])
    log, samples = read(file.getvalue(), "log.tdms")
    assert [channel.kind for channel in log.channels] == ["text", "number"]
    assert_array_equal(samples["a/x"], [0, 1])
    with pytest.raises(BadLog, match="'a/words' holds text"):
        next(log.blocks(["a/words"]))


def test_a_channel_is_found_by_its_last_part_where_only_one_has_it() -> None:
    log, _ = read(
        written({"Motors/Roll current": np.arange(2.0), "a/q": np.arange(2.0), "b/q": np.arange(2.0)}), "x.tdms"
    )
    assert log.find("Roll current").name == "Motors/Roll current"
    assert log.find(2).name == "b/q"
    with pytest.raises(BadLog, match="2 channels are called 'q'; write 'a/q' or 'b/q'"):
        log.find("q")
    with pytest.raises(BadLog, match="no channel 'Roll curent' among its 3; the closest are 'Motors/Roll current'"):
        log.find("Roll curent")
    with pytest.raises(BadLog, match="no column 3; its 3 columns are counted from 0"):
        log.find(3)


def test_a_scaled_channel_is_read_once_however_long_its_chunk(monkeypatch: pytest.MonkeyPatch) -> None:
    scale = {
        "NI_Scaling_Status": "unscaled", "NI_Number_Of_Scales": 1, "NI_Scale[0]_Scale_Type": "Linear",
        "NI_Scale[0]_Linear_Slope": 2.0, "NI_Scale[0]_Linear_Y_Intercept": 1.0,
        "NI_Scale[0]_Linear_Input_Source": 0xFFFFFFFF,
    }  # fmt: skip
    made, rows = io.BytesIO(), 2 * tdms_samples.BLOCK // 8  # so that the chunk is read in pieces
    with TdmsWriter(made) as writer:
        writer.write_segment([ChannelObject("a", "raw", np.arange(rows, dtype=np.float64), scale)])
    octets: list[int] = []
    own = tdms_samples.read_at
    monkeypatch.setattr(tdms_samples, "read_at", lambda file, at, many: (octets.append(many), own(file, at, many))[1])
    _, samples = read(made.getvalue(), "log.tdms")
    assert_array_equal(samples["a/raw"], 2.0 * np.arange(rows) + 1.0)
    assert len(octets) > 2
    assert sum(octets) == 8 * rows


def test_a_count_of_scales_that_was_damaged_is_refused_before_anything_is_made_of_it() -> None:
    for count in (2**31 - 1, 3, -1):
        scale = {
            "NI_Number_Of_Scales": np.int32(count), "NI_Scale[1]_Scale_Type": "Linear",
            "NI_Scale[1]_Linear_Slope": 2.0, "NI_Scale[1]_Linear_Y_Intercept": 1.0,
        }  # fmt: skip
        file = io.BytesIO()
        with TdmsWriter(file) as writer:
            writer.write_segment([ChannelObject("a", "raw", np.array([1, 2], dtype=np.int16), scale)])
        with pytest.raises(BadLog, match=f"claims {count} scales but describes 1: the file is damaged"):
            read(file.getvalue(), "log.tdms")


def test_complex_channels_are_called_that() -> None:
    file = io.BytesIO()
    with TdmsWriter(file) as writer:
        writer.write_segment([ChannelObject("a", "z", np.array([1 + 2j, 3j])), ChannelObject("a", "x", np.arange(2.0))])
    log, samples = read(file.getvalue(), "log.tdms")
    assert [channel.kind for channel in log.channels] == ["complex numbers", "number"]
    assert_array_equal(samples["a/x"], [0, 1])
    with pytest.raises(BadLog, match="channel 'a/z' holds complex numbers, not numbers"):
        next(log.blocks(["a/z"]))


def test_channels_that_are_called_alike_are_remarked_on() -> None:
    file = io.BytesIO()
    with TdmsWriter(file) as writer:
        writer.write_segment([ChannelObject("a/b", "c", np.array([1.0])), ChannelObject("a", "b/c", np.array([2.0]))])
    log, samples = read(file.getvalue(), "log.tdms")
    assert (samples["a/b/c"], samples["a/b/c_1"]) == ([1], [2])
    assert log.warnings == ["more than one channel is called 'a/b/c'; one of them is read as 'a/b/c_1'"]


@pytest.mark.parametrize("chunk", [1, 7, 10**9])
def test_values_of_daq_cards_are_read_as_npTDMS_reads_them_however_long_their_chunks(
    monkeypatch: pytest.MonkeyPatch, chunk: int
) -> None:
    monkeypatch.setattr(tdms_samples, "PIECE_ROWS", chunk)
    raw = {f"a/{i}": np.arange(i, 40 + i, dtype=np.int16) for i in range(3)}
    content = daqmx(raw, slope=0.5, chunks=4) * 3
    _, samples = read(content, "log.tdms")
    for name, values in raw.items():
        assert_array_equal(samples[name], np.tile(0.5 * values + 1, 3))
        assert_array_equal(samples[name], TdmsFile.read(io.BytesIO(content))["a"][name[2:]][:])


def in_segments(*units: str) -> bytes:
    """A channel whose segments state these units; written by npTDMS."""
    file = io.BytesIO()
    for unit in units:
        with TdmsWriter(file) as writer:
            writer.write_segment([ChannelObject("G", "x", np.arange(5.0), {"unit_string": unit})])
    return file.getvalue()


def test_a_unit_that_is_stated_late_is_the_unit_of_the_channel():
    log, samples = read(in_segments("", "g"), "log.tdms")
    assert log.find("G/x").unit == "g"
    assert_array_equal(samples["G/x"], [*range(5), *range(5)])


def test_a_unit_that_changes_is_refused():
    for units in (("g", "V"), ("", "g", "V")):
        with pytest.raises(BadLog, match="mean two things"):
            read(in_segments(*units), "log.tdms")
