"""Columns of numbers in text, in any dialect."""

import gzip
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from davinci_forces.errors import BadLog
from davinci_forces.logs import lines as log_lines
from davinci_forces.logs.log import Options
from tests.logs.cutting import is_cut_honestly
from tests.logs.reading import read, whole

VALUES = st.floats(allow_nan=False, allow_infinity=False, width=64)
DIALECTS = [("\t", "."), ("\t", ","), (";", "."), (";", ","), (",", "."), ("  ", ".")]


@st.composite
def dialects(draw: Any) -> tuple[bytes, np.ndarray[Any, Any], str]:
    """A file, its samples, and the delimiter."""
    delimiter, decimal = draw(
        st.sampled_from([("\t", "."), ("\t", ","), (";", "."), (";", ","), (",", "."), ("  ", ".")])
    )
    columns, rows = draw(st.integers(2, 5)), draw(st.integers(2, 8))
    values = np.array(
        draw(st.lists(st.lists(VALUES, min_size=columns, max_size=columns), min_size=rows, max_size=rows))
    )
    lines = [delimiter.join(repr(float(v)).replace(".", decimal) for v in row) for row in values]
    # A mark in the first row, for an integer such as 1e+300 has none and leaves the decimal mark open.
    lines[0] = delimiter.join([f"0{decimal}5", *lines[0].split(delimiter)[1:]])
    values[0, 0] = 0.5
    if draw(st.booleans()):
        lines.insert(0, delimiter.join(f"q{i}" for i in range(columns)))
    end = draw(st.sampled_from(["\r\n", "\n", "\r", "\r\r\n"]))
    return (end.join(lines) + end).encode(draw(st.sampled_from(["utf-8", "utf-8-sig", "utf-16"]))), values, delimiter


@given(dialects())
@settings(max_examples=150)
def test_any_table_in_any_dialect_reads_back_bit_for_bit(file: tuple[bytes, Any, str]) -> None:
    content, values, _ = file
    _, samples = read(content, "log.csv")
    assert_array_equal(np.column_stack(list(samples.values())), values)


@given(dialects(), st.data())
@settings(max_examples=100)
def test_any_table_cut_at_any_byte_gives_whole_rows_or_a_clear_error(
    file: tuple[bytes, Any, str], data: st.DataObject
) -> None:
    content = file[0]
    is_cut_honestly(content, data.draw(st.integers(0, len(content))), "log.csv")


def text(*lines: str, **options: Any) -> Any:
    return read(("\n".join(lines) + "\n").encode(), "log.csv", Options(**options))


def test_columns_without_a_header_are_numbered() -> None:
    log, samples = text("0.5,1", "0.6,2")
    assert list(samples) == ["column_0", "column_1"]
    assert log.find(1).name == "column_1"
    assert log.facts == {"delimiter": "comma", "decimal mark": ".", "header": "none: columns are numbered from 0"}


def test_units_in_the_header_are_the_channels_units_and_names_stay_as_written() -> None:
    log, _ = text("t [s];q (rad);plain", "0,5;1;2", "0,6;1;2")
    assert [(channel.name, channel.unit) for channel in log.channels] == [
        ("t [s]", "s"),
        ("q (rad)", "rad"),
        ("plain", ""),
    ]


def test_a_line_of_units_below_the_names_is_not_a_name() -> None:
    log, samples = text("Recorded by <script>", "t\tq", "s\trad", "0.5\t1", "0.6\t2")
    assert [(channel.name, channel.unit) for channel in log.channels] == [("t", "s"), ("q", "rad")]
    assert log.comments == ["Recorded by <script>"]
    assert_array_equal(samples["q"], [1, 2])


def test_a_commented_header_gives_the_names() -> None:
    log, samples = text("# t q", "0.0 1.0", "1.0 2.0")
    assert list(samples) == ["t", "q"]
    assert log.facts["delimiter"] == "space"


def test_a_delimiter_at_the_end_of_every_row_makes_no_channel() -> None:
    _, samples = text("t;q;", "0,5;1;", "0,6;2;")
    assert list(samples) == ["t", "q"]


def test_blank_lines_are_skipped_and_a_cut_last_row_is_dropped() -> None:
    log, samples = read(b"t,q\n0.5,1\n\n0.6,2\n0.7,3", "log.csv")
    assert_array_equal(samples["t"], [0.5, 0.6])
    assert log.dropped == 1
    assert log.warnings == ["line 5: the file ends within this row, which is dropped"]


def test_empty_cells_are_nulls_and_nan_is_nan() -> None:
    log, samples = text("t,q", "0.5,", "0.6,NaN", "0.7,3")
    assert_array_equal(samples["q"], [np.nan, np.nan, 3])
    assert (log.nulls["q"], log.nans["q"]) == (1, 1)


def test_a_narrow_row_in_the_middle_is_filled_and_told_of() -> None:
    log, samples = text("t,q", "0.5,1", "0.6", "0.7,3")
    assert_array_equal(samples["q"], [1, np.nan, 3])
    assert log.warnings == ["line 3: the first of 1 rows with too few cells; missing ones are nulls"]


@pytest.mark.parametrize(
    ("lines", "options", "words"),
    [
        (("t;q", "0,5;1", "0,6;bad", "0,7;3"), {}, r"log.csv:3: 'bad' in column 1 \(q\) is not a number"),
        (("t,q", "0.5,1", "0.6,1,2", "0.7,3"), {}, "log.csv:3: the row has 3 cells, but the log has 2 columns"),
        (("t,q,x", "0.5,1", "0.6,1", "0.7,3", "0.8,3"), {}, "the header names 3 columns"),
        (("0,5", "0,6", "0,7"), {}, "the comma may be the delimiter, the decimal mark, or both; set `delimiter`"),
        (("0,05,1,25", "0,06,1,26"), {}, "the comma may be"),
        (("abc", "def"), {}, "no delimiter"),
        (("0,5,1", "0,6,2"), {"delimiter": ",", "decimal": ","}, "no delimiter"),
        (("0.4;1", "0.5;1.000,5", "0.6;2"), {}, "is not a number with the decimal mark"),
        (("bad;1;2", "0.5;1;2", "0.6;1;2"), {}, "holds numbers and text"),
    ],
)  # fmt: skip
def test_what_can_be_read_in_two_ways_or_none_is_refused_with_the_remedy(lines: Any, options: Any, words: str) -> None:
    with pytest.raises(BadLog, match=words):
        text(*lines, **options)


def test_the_study_settles_what_the_file_leaves_open() -> None:
    _, samples = text("0,5", "1,5", "2,5", decimal=",")
    assert_array_equal(samples["column_0"], [0.5, 1.5, 2.5])
    _, samples = text("0,5", "1,5", "2,5", delimiter="comma")
    assert_array_equal(samples["column_1"], [5, 5, 5])
    _, samples = text("1;2", "3;4", header=True)
    assert list(samples) == ["1", "2"]


def test_a_header_settles_whether_the_comma_is_a_delimiter() -> None:
    _, samples = text("t,q", "0,5", "1,6")
    assert_array_equal(samples["q"], [5, 6])
    _, samples = text("force", "0,5", "1,6")
    assert_array_equal(samples["force"], [0.5, 1.6])


def test_rows_that_labview_writes_without_headings_are_read() -> None:
    _, samples = read(b"\t1,000000\t4,000000\r\n\t2,500000\t5,000000\r\n", "log.lvm")
    assert_array_equal(samples["column_1"], [1, 2.5])
    assert np.isnan(samples["column_0"]).all()
    _, samples = read(b"X_Value\tUntitled\tComment\r\n0,000000\t4,000000\r\n1,000000\t5,000000\r\n", "log.lvm")
    assert list(samples) == ["X_Value", "Untitled"]


def test_a_zipped_log_is_read_as_far_as_it_is_whole() -> None:
    rows = "".join(f"{i / 7!r},{i}\n" for i in range(5000))
    packed = gzip.compress(rows.encode(), mtime=0)
    log, samples = read(packed, "log.csv.gz")
    assert len(samples["column_1"]) == 5000
    assert not log.warnings
    log, samples = read(packed[: len(packed) // 2], "log.csv.gz")
    assert_array_equal(samples["column_1"], np.arange(len(samples["column_1"])))
    assert 1000 < len(samples["column_1"]) < 5000
    assert any("the compressed file is cut" in warning for warning in log.warnings)


def test_a_second_member_of_a_gzip_file_that_is_cut_is_told_of(tmp_path) -> None:
    first, second = gzip.compress(b"1\n"), gzip.compress(b"2\n" * 100)
    (tmp_path / "log.csv.gz").write_bytes(first + second[:-9])
    lines = log_lines.Lines(tmp_path / "log.csv.gz")
    assert b"".join(text for _, text, _ in lines.blocks(len(first))).startswith(b"1\n")  # which ends with a piece
    assert "is cut" in lines.damage


def test_quoted_cells_are_read_without_their_quotes() -> None:
    _, samples = text('"t, first","q"', '"0.5","1"', '"0.6","2"')
    assert list(samples) == ["t, first", "q"]
    assert_array_equal(samples["q"], [1, 2])


def test_a_column_of_days_is_text_and_the_others_are_read() -> None:
    log, samples = text("when;q", "2026-10-15;1,5", "2026-10-15;2,5")
    assert [channel.kind for channel in log.channels] == ["text", "number"]
    assert_array_equal(samples["q"], [1.5, 2.5])


def test_recordings_of_other_arms_have_the_columns_that_their_notes_say(data: Any) -> None:
    for name, columns, rows in (
        ("dvrk_wpi/one.csv", 21, 5999),
        ("dvrk_slide/arm_fourier2.csv", 9, 5990),
        ("ur10e/joint_1.csv", 31, 5889),
        ("palpation/phantom_T1_probes.csv", 4, 7270),
        ("ur5/No10_Standstill_ForceSensor_All__i_target.csv", 7, 3507),
    ):
        _, samples = whole(data / name)
        table = np.loadtxt(data / name, delimiter=",", skiprows=int("palpation" in name), max_rows=rows)
        assert len(samples) == columns
        assert_array_equal(np.column_stack(list(samples.values())), table)


@pytest.mark.parametrize(
    ("cells", "wanted", "started", "zone"),
    [
        (("23:59:59.5", "00:00:00", "0:00:00.25"), [86399.5, 86400, 86400.25], "", ""),
        (("2026-10-15T02:26:06.304Z", "2026-10-15T02:26:06.314Z"), [0, 0.01], "2026-10-15T02:26:06.304000", "UTC"),
        (("2026-10-15T02:26:06+02:00", "2026-10-15T00:26:07+0000"), [0, 1], "2026-10-15T00:26:06", "UTC"),
        (("2026/10/15 02:26:06,304", "2026/10/15 02:26:07"), [0, 0.696], "2026-10-15T02:26:06.304000", "local"),
        (("2026-10-15 23:59", "2026-10-16 00:01"), [0, 120], "2026-10-15T23:59:00", "local"),
    ],
)
def test_a_column_of_times_is_the_time(cells: tuple[str, ...], wanted: list[float], started: str, zone: str) -> None:
    log, samples = text("when;q", *(f"{cell};1,5" for cell in cells))
    assert (log.time, log.started, log.zone) == ("when", started, zone)
    assert_allclose(samples["when"], wanted, rtol=0, atol=1e-9)


@given(st.integers(0, 86_399_999), st.lists(st.integers(1, 40_000_000), min_size=1, max_size=30), st.integers(1, 9))
def test_times_of_day_go_on_past_any_midnight_in_blocks_of_any_size(begin: int, steps: list[int], size: int) -> None:
    at = begin + np.concatenate(([0], np.cumsum(steps)))  # [ms]
    cells = [
        f"{ms // 3_600_000 % 24:02}:{ms // 60_000 % 60:02}:{ms // 1000 % 60:02}.{ms % 1000:03}" for ms in at.tolist()
    ]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(log_lines.Lines.blocks, "__defaults__", (16 * size,))
        _, samples = text("t,q", *(f"{cell},1" for cell in cells))
    assert_allclose(samples["t"], 1e-3 * at, rtol=1e-12)


def test_columns_of_days_and_of_times_make_rows_though_most_cells_are_no_numbers() -> None:
    log, samples = text("2026-10-15 02:26:06.304 1.5", "2026-10-15 02:26:06.314 2.5")
    assert [channel.kind for channel in log.channels] == ["text", "time", "number"]
    assert_allclose(samples["column_1"], [8766.304, 8766.314], rtol=1e-12)


def test_a_cell_that_is_no_time_is_named_with_its_place() -> None:
    with pytest.raises(BadLog, match=r":3: '02:26:x' in column 0 \(t\) is not a time in the format of the rows before"):
        text("t,q", "02:26:06,1", "02:26:x,2", "02:26:07,3", "02:26:08,3")
    with pytest.raises(BadLog, match=r":2: '2026-02-2x 02:26' in column 0 \(t\) is not a time"):
        text("t,q", "2026-02-2x 02:26,1", "2026-02-28 02:27,2", "2026-02-28 02:28,2")
    with pytest.raises(BadLog, match="a time that is not a valid date"):
        text("t,q", "2026-02-28 02:26:06,1", "2026-02-30 02:26:06,2")


def test_columns_that_are_called_alike_are_remarked_on() -> None:
    log, _ = text("t,q,q", "0,1,2", "1,3,4")
    assert log.warnings == ["more than one column is called 'q'; column 2 is read as 'q_1'"]
