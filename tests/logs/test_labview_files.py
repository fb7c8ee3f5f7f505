"""Files that LabVIEW wrote, against what another reader says that they hold; and damaged ones."""

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from davinci_forces.errors import BadLog
from davinci_forces.logs.log import Log
from tests.logs.cutting import is_cut_honestly
from tests.logs.reading import Samples, whole


@pytest.fixture(scope="module")
def labview(data: Path) -> Path:
    return data / "labview"


def expected(labview: Path, kind: str) -> dict[str, Any]:
    files: dict[str, Any] = json.loads((labview / "EXPECTED.json").read_text())
    return {name: file for name, file in files.items() if file["format"] == kind}


def test_every_lvm_file_reads_as_another_reader_read_it(labview: Path) -> None:
    files = expected(labview, "lvm")
    assert len(files) >= 14
    for name, file in files.items():
        if name != "lv2026_one_header_more.lvm":
            agrees_with_segments(*whole(labview / name), file)


def agrees_with_segments(log: Log, samples: Samples, file: dict[str, Any]) -> None:
    names = {channel.name: channel.unit for channel in log.channels}
    rows = [segment["rows"] for segment in file["segments"]]
    assert {len(values) for values in samples.values()} == {sum(rows)}
    assert log.facts["segments"] == str(file["n_segments"])
    for segment, end in zip(file["segments"], np.cumsum(rows), strict=True):
        part = {name: values[end - segment["rows"] : end] for name, values in samples.items()}
        for i, (name, unit) in enumerate(zip(segment["names"], segment["units"], strict=True)):
            assert names[name] == (unit or "")
            if i < 3:
                shown = [part[each] for each in samples if each in segment["names"]]
                numbers = [values for values in shown if not np.isnan(values).all()]
                assert numbers[i][0] == segment["first"][i]
                assert numbers[i][-1] == segment["last"][i]
        if math.isnan(segment["x_first"]):
            assert "X_Value" not in names
            assert log.clock is not None
            assert log.clock.step == segment["delta_x"][0]
        else:
            assert (part["X_Value"][0], part["X_Value"][-1]) == (segment["x_first"], segment["x_last"])
    first = file["segments"][0]
    assert log.started.startswith(first["start"][0].replace("/", "-").replace(" ", "T").replace(",", ".")[:23])
    assert log.zone == "local"
    assert len(log.comments) == sum(segment["comments"] for segment in file["segments"])
    kept_apart = sum(log.nulls[name] for name in first["names"])
    if file["n_segments"] == 1:
        assert kept_apart == sum(segment["empty_cells"] for segment in file["segments"])
    assert sum(log.nans.values()) == 0


def test_a_write_with_more_channels_and_no_header_keeps_every_cell(labview: Path) -> None:
    log, samples = whole(labview / "lv2026_one_header_more.lvm")
    assert_array_equal(samples["Untitled"], [1, 2.5, -3.25, 5, 6])
    assert_array_equal(samples["Untitled 1"], [4, 5, 6, 7, 8])
    assert_array_equal(samples["column_3"], [np.nan, np.nan, np.nan, 9, 10])
    assert [comment.rpartition(" ")[2] for comment in log.comments] == ["c1", "c2"]
    assert log.nulls["column_3"] == 3


def test_every_tdms_file_reads_as_another_reader_read_it(labview: Path) -> None:
    files = expected(labview, "tdms")
    assert len(files) >= 11
    for name, file in files.items():
        if "ref_error" in file:
            with pytest.raises(BadLog, match=name):
                whole(labview / name)
        else:
            agrees_with_channels(*whole(labview / name), file)


def agrees_with_channels(log: Log, samples: Samples, file: dict[str, Any]) -> None:
    assert log.facts["segments"] == str(file["segments"])
    assert len(log.channels) == file["n_channels"]
    for channel, said in zip(log.channels, file["channels"], strict=True):
        assert channel.name == f"{said['group']}/{said['name']}"
        assert log.find(channel.name) == channel
        assert channel.unit == (said["unit"] or "")
        values = samples[channel.name]
        assert len(values) == said["n"]
        if channel.kind == "time":
            assert log.started == said["first"]
            assert_array_equal(values, np.arange(said["n"]))
        else:
            assert (values[0], values[-1]) == (said["first"], said["last"])
        if said["dt"] is not None:
            assert log.clock is not None
            assert log.clock.step == said["dt"]
        if said["start_time"]:
            assert log.zone == "UTC"
    if file["channels"][0].get("start_time"):
        assert log.started == file["channels"][0]["start_time"]


# How each damaged file is to behave: the words of the error; or rows, and the words of the warning ("" for none).
SENSES: dict[str, str | tuple[int, str]] = {
    "empty.lvm": "empty",
    "no_end_of_header.lvm": "End_of_Header",
    "header_only_no_rows.lvm": (0, "no rows"),
    "truncated_mid_cell_row_short.lvm": (999, "ends within this row"),
    "bom.lvm": (3, ""),
    "lf_only.lvm": (3, ""),
    "latin1_degree.lvm": (3, ""),
    "semicolon_sep.lvm": (3, ""),
    "row_too_narrow.lvm": (3, "line 24: the first of 1 rows with too few cells"),
    "nan_inf.lvm": (3, ""),
    "dup_names.lvm": (3, "read as 'Voltage_1'"),
    "nonmono_time.lvm": (3, "x goes back from 1 to 0.5 in row 3"),
    "thousands.lvm": ":24: '1.002,500000' in column 1",
    "samples_wrong.lvm": (3, "the header states 500 samples, but 3 rows follow"),
    "no_x_value_line.lvm": ":22: the column line.* is missing",
    "special_between.lvm": (3, ""),
    "nul_tail.lvm": (3, "4096 NUL bytes"),
    "huge_field.lvm": (3, ""),
    "blank_lines.lvm": (3, "after a blank line"),
    "freq_domain.lvm": "the x axis is Frequency",
    "empty.tdms": "empty",
    "cut_in_metadata.tdms": "no channel",
    "cut_mid_sample.tdms": (1251, "lacks 1003 bytes"),
    "ffff_next_offset.tdms": (1251, "never written"),
    "bad_mid_tag.tdms": (1251, ""),
    "nul_tail.tdms": (1251, "4096 NUL bytes"),
    "index_cut.tdms": (1251, ""),
    "index_junk.tdms": (1251, ""),
    "txt_comma_comma.txt": "the comma may be",
    "txt_header_row.txt": (50, ""),
    "txt_crcrlf.txt": (79, "ends within this row"),
    "txt_1904_time.txt": (99, "ends within this row"),
}


def test_every_damaged_file_is_told_of() -> None:
    assert len(SENSES) >= 32


@pytest.mark.parametrize("name", SENSES)
def test_a_damaged_file_is_read_as_far_as_it_can_be_trusted(labview: Path, name: str) -> None:
    assert name in json.loads((labview / "malformed" / "CASES.json").read_text())
    wanted, path = SENSES[name], labview / "malformed" / name
    if isinstance(wanted, str):
        with pytest.raises(BadLog, match=wanted):
            whole(path)
        return
    log, samples = whole(path)
    rows, words = wanted
    assert {len(values) for values in samples.values()} == {rows}
    assert any(words in warning for warning in log.warnings) if words else not log.warnings


def test_all_cases_of_damage_are_walked(labview: Path) -> None:
    assert set(json.loads((labview / "malformed" / "CASES.json").read_text())) == set(SENSES)


def test_special_values_stay_what_they_are_and_nan_is_no_empty_cell(labview: Path) -> None:
    log, samples = whole(labview / "malformed" / "nan_inf.lvm")
    assert_array_equal(samples["Untitled"], [1, np.nan, -np.inf])
    assert_array_equal(samples["Untitled 1"], [np.inf, 5, 6])
    assert (log.nans["Untitled"], log.nulls["Untitled"]) == (1, 0)
    log, samples = whole(labview / "malformed" / "row_too_narrow.lvm")
    assert (log.nans["Untitled 1"], log.nulls["Untitled 1"]) == (0, 1)


def test_units_in_the_windows_code_page_are_read(labview: Path) -> None:
    log, _ = whole(labview / "malformed" / "latin1_degree.lvm")
    assert [channel.unit for channel in log.channels][1:3] == ["°C", "µV"]


def test_a_stale_or_broken_index_beside_a_tdms_file_is_not_trusted(labview: Path, tmp_path: Path) -> None:
    content = (labview / "malformed" / "index_cut.tdms").read_bytes()
    (tmp_path / "log.tdms_index").write_bytes(b"TDSh" + content[4:120])
    (tmp_path / "log.tdms").write_bytes(content)
    _, samples = whole(tmp_path / "log.tdms")
    assert len(samples) == 5


def test_a_segment_whose_length_was_never_written_ends_where_the_next_begins(labview: Path) -> None:
    _, whole_file = whole(labview / "malformed" / "index_cut.tdms")
    _, unfinished = whole(labview / "malformed" / "ffff_next_offset.tdms")
    assert whole_file.keys() == unfinished.keys()
    for name, values in whole_file.items():
        assert_allclose(unfinished[name], values, rtol=0, atol=0)


def test_a_file_of_each_kind_cut_at_every_other_byte_gives_whole_rows_or_a_clear_error(labview: Path) -> None:
    for name in ("lv2026_one_header_more.lvm", "nitdms_channeldata_2groups.tdms", "malformed/txt_header_row.txt"):
        content = (labview / name).read_bytes()
        for length in range(0, len(content), 2):
            is_cut_honestly(content, length, Path(name).name)
