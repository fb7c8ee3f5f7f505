"""LabVIEW measurement files in every style that LabVIEW writes, read back bit for bit."""

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from davinci_forces.errors import BadLog
from davinci_forces.logs import lines, open_log
from davinci_forces.logs.log import Options
from davinci_forces.logs.lvm import walk as lvm_walk
from tests.logs.cutting import is_cut_honestly
from tests.logs.lvm_writer import Style, Write, lvm
from tests.logs.reading import read

CELLS = st.none() | st.floats(width=64)
NAMES = st.text(st.characters(blacklist_categories=("C", "Z"), blacklist_characters="\t;,\r\n"), min_size=1, max_size=8)
NO_CHANNEL = {"X_Value", "Comment", "elapsed"}


@st.composite
def tables(draw: Any) -> tuple[list[Write], Style]:
    """Writes of one log, in any style."""
    separator, decimal = draw(st.sampled_from([("\t", ","), ("\t", "."), (";", ","), (";", "."), (",", ".")]))
    style = Style(
        x_columns=draw(st.sampled_from(["No", "One", "Multi"])),
        several=draw(st.booleans()),
        separator=separator,
        decimal=decimal,
        cell_decimal=draw(st.sampled_from(["", "."] if separator == "\t" else [""])),
        end=draw(st.sampled_from(["\r\n", "\n", "\r"])),
        encoding=draw(st.sampled_from(["utf-8", "utf-8-sig", "utf-16"])),
        special=draw(st.booleans()),
    )
    names = draw(st.lists(NAMES.filter(lambda name: name not in NO_CHANNEL), min_size=1, max_size=4, unique=True))
    return [_write(draw, names) for _ in range(draw(st.integers(1, 3)))], style


def _write(draw: Any, names: list[str]) -> Write:
    rows = draw(st.integers(1, 5))
    columns = {name: draw(st.lists(CELLS, min_size=rows, max_size=rows)) for name in names}
    start = draw(st.floats(-1e6, 1e6))
    comment = draw(st.sampled_from(["", "grasped the needle", "a"]))
    return Write(columns, x=[start + 0.5 * i for i in range(rows)], comment=comment)


@given(tables())
@settings(max_examples=150)
def test_any_table_in_any_style_reads_back_bit_for_bit(table: tuple[list[Write], Style]) -> None:
    writes, style = table
    log, samples = read(lvm(writes, style))
    names = list(writes[0].columns)
    for name in names:
        cells = [cell for write in writes for cell in write.columns[name]]
        assert_same(samples[name], cells)
        assert log.nulls[name] == sum(cell is None for cell in cells)
        assert log.nans[name] == sum(cell is not None and math.isnan(cell) for cell in cells)
    if style.x_columns != "No":
        assert_same(samples["X_Value"], [x for write in writes for x in write.x])
    assert len(log.comments) == sum(bool(write.comment) for write in writes)


def assert_same(values: Any, cells: list[float | None]) -> None:
    """Bit for bit, but for the payload of a NaN."""
    wanted = np.array([np.nan if cell is None else cell for cell in cells])
    assert_array_equal(values, wanted)
    assert_array_equal(np.signbit(values[~np.isnan(wanted)]), np.signbit(wanted[~np.isnan(wanted)]))


@given(tables(), st.data())
@settings(max_examples=100, suppress_health_check=[HealthCheck.too_slow])
def test_any_table_cut_at_any_byte_gives_whole_rows_or_a_clear_error(
    table: tuple[list[Write], Style], data: st.DataObject
) -> None:
    content = lvm(*table)
    is_cut_honestly(content, data.draw(st.integers(0, len(content))), "log.lvm")


def test_blocks_of_any_size_give_the_same_samples(monkeypatch: pytest.MonkeyPatch) -> None:
    rng = np.random.default_rng(1)
    columns = {"a": list(rng.standard_normal(300)), "b": list(rng.standard_normal(300))}
    writes = [Write(columns, x=list(range(300)), comment=f"pass {i}") for i in range(3)]
    for style in (Style(), Style(several=False), Style(x_columns="Multi", end="\n"), Style(x_columns="No")):
        content = lvm(writes, style)
        log, at_once = read(content)
        for size in (61, 1000, 7001):
            with monkeypatch.context() as patch:
                patch.setattr(lvm_walk, "LINEWISE_BYTES", size // 4)
                patch.setattr(lines.Lines.blocks, "__defaults__", (size,))
                again, in_blocks = read(content)
            assert again.warnings == log.warnings
            assert again.comments == log.comments
            for name, values in at_once.items():
                assert_array_equal(in_blocks[name], values)


def test_a_blank_line_in_a_block_of_rows_is_noticed(monkeypatch: pytest.MonkeyPatch) -> None:
    rows = [float(i) for i in range(400)]
    content = lvm([Write({"a": rows}, x=rows)], Style(several=False, end="\n"))
    monkeypatch.setattr(lvm_walk, "LINEWISE_BYTES", 64)
    log, samples = read(content.replace(b"\n300,0\t", b"\n\n300,0\t"))
    assert_array_equal(samples["a"], rows)
    assert log.warnings == ["line 324: rows continue after a blank line without a header; they are read as before"]


def test_reading_again_tells_the_same_once(tmp_path: Path) -> None:
    path = tmp_path / "log.lvm"
    path.write_bytes(lvm([Write({"a": [1.0, None]}, x=[1.0, 0.0], comment="go", samples=9)]))
    log = open_log(path)
    told = []
    for _ in range(2):
        assert sum(len(block["a"]) for block in log.blocks(["a"])) == 2
        told.append((list(log.warnings), list(log.comments), dict(log.nulls)))
    assert told[0] == told[1]
    assert len(told[0][0]) == 2


def test_half_a_letter_at_the_end_is_told_of() -> None:
    content = lvm([Write({"a": [1.0]}, x=[0.0])], Style(encoding="utf-16", several=False)) + b"\x31"
    log, samples = read(content)
    assert_array_equal(samples["a"], [1])
    assert (log.dropped, log.warnings) == (1, ["line 24: the file ends within this row, which is dropped"])


def test_rows_where_x_restarts_without_a_header_are_kept_and_told_of() -> None:
    writes = [Write({"a": [1.0, 2.0]}, x=[0.0, 0.01]) for _ in range(4)]
    log, samples = read(lvm(writes, Style(several=False)))
    assert_array_equal(samples["a"], [1, 2] * 4)
    assert "goes back from 0.01 to 0 in row 3 (the first of 3 times)" in log.warnings[0]


def test_a_loop_that_writes_one_sample_per_call_keeps_every_row() -> None:
    writes = [Write({"a": [float(i)]}, x=[0.0]) for i in range(50)]
    log, samples = read(lvm(writes, Style(several=False)))
    assert_array_equal(samples["a"], np.arange(50))
    assert "x stands still at 0 in row 2 (the first of 49 times)" in log.warnings[0]


def test_segments_are_put_on_one_time_axis_by_their_dates() -> None:
    starts = ("02:26:06,5", "02:26:09,75", "02:27:06,5")
    for x_columns in ("One", "No"):
        writes = [Write({"a": [1.0, 2.0]}, x=[0.0, 1.0], start=start) for start in starts]
        log, samples = read(lvm(writes, Style(x_columns=x_columns)))
        assert log.time == "elapsed"
        assert log.clock is None
        assert_allclose(samples["elapsed"], [0, 1, 3.25, 4.25, 60, 61], rtol=1e-15)


def test_a_log_without_x_has_the_clock_of_its_header() -> None:
    log, _ = read(lvm([Write({"a": [1.0, 2.0]}, step=1 / 512)], Style(x_columns="No")))
    assert log.clock is not None
    assert (log.clock.start, log.clock.step) == (0.0, 1 / 512)
    assert not log.warnings


def test_an_interval_that_lost_its_digits_is_told_of() -> None:
    log, _ = read(lvm([Write({"a": [1.0, 2.0]}, step=0.000488)], Style(x_columns="No")))
    assert "the sampling interval of 0,000488 s is rounded, so the clock may be wrong by 0.10%" in log.warnings[0]
    log, _ = read(lvm([Write({"a": [1.0, 2.0]}, step=0.001)], Style(x_columns="No")))
    assert not log.warnings


def test_what_recurs_is_told_of_a_few_times_and_counted() -> None:
    writes = [Write({"a": [1.0]}, x=[0.0], samples=2) for _ in range(20)]
    log, samples = read(lvm(writes))
    assert_array_equal(samples["a"], np.ones(20))
    assert log.warnings[-1] == "15 more times: line #: the header states # samples, but # rows follow; these are read"
    assert len(log.warnings) == 6


def test_a_write_that_loses_a_channel_keeps_its_rows_and_its_comment() -> None:
    style = Style(several=False)
    content = lvm([Write({"a": [1.0, 2.0], "b": [3.0, 4.0]}, x=[0.0, 1.0], comment="c1")], style)
    fewer = lvm([Write({"a": [5.0, 6.0]}, x=[0.0, 1.0], comment="c2")], style)
    log, samples = read(content + b"\r\n".join(fewer.split(b"\r\n")[-3:]))
    assert_array_equal(samples["a"], [1, 2, 5, 6])
    assert_array_equal(samples["b"], [3, 4, np.nan, np.nan])
    assert [comment.rpartition(" ")[2] for comment in log.comments] == ["c1", "c2"]
    assert any("2 rows with too few cells" in warning for warning in log.warnings)


def test_names_that_look_like_markup_come_through_as_they_are() -> None:
    names = ["<script>alert(1)</script>", "#set page()", "Motors/Roll current"]
    log, samples = read(lvm([Write({name: [1.0] for name in names}, x=[0.0])]))
    assert [channel.name for channel in log.channels][1:4] == names
    assert log.facts["Operator"] == "<script>"
    assert log.find("Roll current").name == "Motors/Roll current"
    assert set(names) < set(samples)


def test_a_unit_with_a_slash_in_a_name_is_read() -> None:
    names = {"Roll vel (deg/s)": "deg/s", "Motors/Roll vel [rad/s]": "rad/s"}
    log, _ = read(lvm([Write({name: [1.0] for name in names}, x=[0.0])]))
    assert {channel.name: channel.unit for channel in log.channels if channel.name in names} == names


def test_a_comment_is_unescaped() -> None:
    log, _ = read(lvm([Write({"a": [1.0]}, x=[0.0], comment=r"one\0Atwo \\ three")]))
    assert log.comments[0].endswith("one\ntwo \\ three")


def test_the_same_mark_for_cells_and_decimals_is_refused() -> None:
    with pytest.raises(BadLog, match="the separator and the decimal mark are both ','"):
        read(lvm([Write({"a": [1.0]}, x=[0.0])], Style(separator=",", decimal=",")))


def test_text_in_a_number_cell_is_named_with_its_place() -> None:
    content = lvm([Write({"a": [1.0, 2.5, 3.0]}, x=[0.0, 1.0, 2.0])]).replace(b"2,5", b"2,5V")
    with pytest.raises(BadLog, match=r"log.lvm:24: '2,5V' in column 1 \(a\) is not a number"):
        read(content)


def test_a_carriage_return_within_a_cell_is_named_with_its_place() -> None:
    content = lvm([Write({"a": [4.0, 5.0]}, x=[0.0, 1.0])])
    at = content.rindex(b"1,0")
    damaged = content[: at + 1] + b"\r" + content[at + 2 :].replace(b"\r\n", b"\n", 1)
    with pytest.raises(BadLog, match=r":24: '1\\r0' in column 0"):
        read(damaged)


def test_a_special_block_that_is_not_closed_is_refused() -> None:
    content = lvm([Write({"a": [1.0]}, x=[0.0])], Style(special=True)).replace(b"***End_Special***", b"***End***")
    with pytest.raises(BadLog, match="the special block is not closed"):
        read(content)


def test_a_later_session_with_its_own_header_continues_the_log() -> None:
    writes = [Write({"a": [1.0]}, x=[0.0]), Write({"a": [2.0], "b": [3.0]}, x=[0.0])]
    log, samples = read(lvm(writes, Style(again=frozenset({1}))))
    assert_array_equal(samples["a"], [1, 2])
    assert_array_equal(samples["b"], [np.nan, 3])
    assert any("another session was appended" in warning for warning in log.warnings)


def test_an_encoding_that_does_not_exist_is_refused() -> None:
    with pytest.raises(BadLog, match="there is no encoding 'ebcdic-9'"):
        read(lvm([Write({"a": [1.0]}, x=[0.0])]), options=Options(encoding="ebcdic-9"))


def test_only_the_channels_asked_for_are_converted() -> None:
    content = lvm([Write({"a": [1.0, 2.0], "b": [3.0, 4.5]}, x=[0.0, 1.0])]).replace(b"4,5", b"4x5")
    log, _ = read(content.replace(b"4x5", b"4,5"))
    with pytest.raises(BadLog, match="4x5"):
        read(content)
    assert log.channels


@pytest.mark.parametrize("separator", [b"\xa7", b"7", b"-"])
def test_a_separator_that_cannot_part_numbers_is_refused(separator: bytes) -> None:
    content = lvm([Write({"a": [1.0]}, x=[0.0])]).replace(b"Separator\tTab", b"Separator" + separator)
    with pytest.raises(BadLog, match=r"the separator is .*, which cannot separate numbers"):
        read(content)


def test_a_file_segment_without_rows_and_a_header_that_does_not_end_are_remarked_on() -> None:
    writes = [Write({"a": [1.0]}, x=[0.0]), Write({"a": []}, samples=0), Write({"a": [2.0]}, x=[1.0])]
    log, samples = read(lvm(writes))
    assert_array_equal(samples["a"], [1, 2])
    assert log.warnings == ["line 33: the file segment whose header ends here holds no rows"]
    content = lvm(writes)
    end = content.rindex(b"***End_of_Header***")
    log, samples = read(content[:end] + content[content.index(b"\n", end) + 1 :])
    assert_array_equal(samples["a"], [1])
    assert any("(no line ***End_of_Header*** ends the header)" in warning for warning in log.warnings)
