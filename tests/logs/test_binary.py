"""Raw binary numbers that study.toml tells of, and TDM files, which are not read."""

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from davinci_forces.errors import BadLog
from davinci_forces.logs.binary import dtype_of
from davinci_forces.logs.log import Options
from tests.logs.reading import read

ROWS = np.arange(60.0).reshape(20, 3)


def sized(*arrays, dtype=">f8", order=">") -> bytes:
    """As LabVIEW writes arrays of two dimensions, each with its sizes before it."""
    return b"".join(np.array(a.shape, f"{order}i4").tobytes() + a.astype(dtype).tobytes() for a in arrays)


@pytest.mark.parametrize(
    ("said", "is_"),
    [("float64", ">f8"), ("DBL", ">f8"), ("<float32", "<f4"), ("SGL", ">f4"), ("I16", ">i2"), ("<u32", "<u4"),
     ("int8", "i1"), ("i2", ">i2"), ("<f8", "<f8"), ("u64", ">u8")],
)  # fmt: skip
def test_types_are_big_endian_unless_told(said, is_):
    assert dtype_of(said) == np.dtype(is_)


@pytest.mark.parametrize("said", ["i8", "u8", "", "<", "float", "complex128", "text"])
def test_what_is_no_type_or_two_is_none(said):
    """LabVIEW counts bits in I8 and numpy bytes in i8."""
    assert dtype_of(said) is None


@pytest.mark.parametrize("dtype", [">f8", "<f4", ">i2"])
def test_rows_are_read_with_and_without_names(dtype):
    content = ROWS.astype(dtype).tobytes()
    log, samples = read(content, "log.bin", Options(dtype=dtype, columns=("t [s]", "q [rad]", "i")))
    assert [channel.unit for channel in log.channels] == ["s", "rad", ""]
    assert_array_equal(samples["q [rad]"], ROWS[:, 1])
    log, samples = read(content, "log", Options(dtype=dtype, columns=3))
    assert_array_equal(samples[log.find(2).name], ROWS[:, 2])


@pytest.mark.parametrize(("dtype", "order"), [(">f8", ">"), ("<f8", "<"), (">i2", ">")])
def test_sizes_before_arrays_are_not_taken_for_samples(dtype, order):
    content = sized(ROWS[:7], ROWS[7:8], ROWS[8:], dtype=dtype, order=order)
    log, samples = read(content, "log.bin", Options(dtype=dtype, columns=3))
    assert_array_equal(np.column_stack(list(samples.values())), ROWS)
    assert log.facts["layout"] == "3 arrays, each with its size before it"


def test_an_array_that_is_cut_keeps_its_whole_rows():
    log, samples = read(sized(ROWS[:7], ROWS[7:])[:-30], "log.bin", Options(dtype="DBL", columns=3))
    assert_array_equal(np.column_stack(list(samples.values())), ROWS[:-2])
    assert log.cut
    assert "ends within a row" in log.warnings[0]


def test_arrays_of_another_width_are_refused():
    with pytest.raises(BadLog, match="byte 176 begins an array without 3 columns"):
        read(sized(ROWS[:7], ROWS[7:].reshape(-1, 13)), "log.bin", Options(dtype="DBL", columns=3))


def test_one_column_may_have_its_count_before_it():
    content = np.array(20, ">i4").tobytes() + ROWS[:, 0].astype(">f8").tobytes()
    _, samples = read(content, "log.bin", Options(dtype="DBL", columns=("q",)))
    assert_array_equal(samples["q"], ROWS[:, 0])


@pytest.mark.parametrize("name", ["log.bin", "log.dat"])
def test_without_a_type_the_message_says_what_to_write(name):
    with pytest.raises(BadLog, match=r'dtype = "float64" and columns = \["time", "q", "i"\]'):
        read(ROWS.astype(">f8").tobytes(), name)


def test_less_than_a_row_is_refused():
    with pytest.raises(BadLog, match="its 8 bytes are fewer than one row of 3 numbers of 8 bytes"):
        read(bytes(8), "log.bin", Options(dtype="DBL", columns=3))


@pytest.mark.parametrize(("name", "content"), [("log.tdm", b'<?xml version="1.0"?>'), ("log.tdx", bytes(100))])
def test_a_tdm_file_says_how_to_make_tdms_of_it(name, content):
    with pytest.raises(BadLog, match="save it as TDMS"):
        read(content, name)
