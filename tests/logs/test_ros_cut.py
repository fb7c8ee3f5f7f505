"""Bags that are cut, that nobody closed, or that are damaged: what is whole is read, and said; nothing is made up."""

import shutil
import struct
import tempfile
from functools import cache
from pathlib import Path
from zlib import crc32

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from davinci_forces.errors import BadLog
from davinci_forces.logs import open_log
from tests.logs.bag_writer import joint_state, vectors, write
from tests.logs.damaging import damaged
from tests.logs.reading import read, whole

COUNT, JOINTS = 900, 12
FEW, MANY = 300, 40  # messages and joints where damages are random: chunks of longer bags are decompressed no better
BAGS = {
    "log.bag": "", "lz4.bag": "lz4", "bz2.bag": "bz2", "log.db3": "", "log.mcap": "", "zstd.mcap": "storage",
    "checked.mcap": "", "checked_zstd.mcap": "storage",
}  # fmt: skip
CHECKED = ("checked.mcap", "checked_zstd.mcap")
MAGIC = 8


def messages(joints: int = JOINTS, count: int = COUNT):
    names = [f"joint_{i}" for i in range(joints)]
    rng = np.random.default_rng(5)
    for i in range(count):
        x = rng.normal(size=(3, joints))
        yield joint_state(0.01 * i, names, *x)
        if i % 3 == 0:
            pairs = (("force", x[0, :3]), ("torque", x[1, :3]))
            yield vectors(0.01 * i + 0.002, "WrenchStamped", "wrench", *pairs, topic="/PSM1/measured_cf")


def records(content: bytes, at: int):
    """The records of an MCAP file: kind, and where the content begins and ends."""
    while at + 9 <= len(content) - MAGIC:
        kind, length = struct.unpack_from("<BQ", content, at)
        yield kind, at + 9, at + 9 + length
        at += 9 + length


def checked(content: bytes) -> bytes:
    """An MCAP file with the checksums of chunks, data and summary, which rosbags does not write."""
    from backports import zstd

    whole = bytearray(content)
    for kind, begin, end in records(content, MAGIC):
        if kind == 6:
            name = struct.unpack_from("<I", content, begin + 28)[0]
            at = begin + 32 + name + 8
            chunk = content[at:end]
            struct.pack_into("<I", whole, begin + 24, crc32(zstd.decompress(chunk) if name else chunk))
        elif kind == 15:
            struct.pack_into("<I", whole, begin, crc32(whole[: begin - 9]))
        elif kind == 2:
            summary = struct.unpack_from("<Q", content, begin)[0]
            struct.pack_into("<I", whole, begin + 16, crc32(whole[summary : begin + 16]))
    return bytes(whole)


@cache
def bag(name: str, joints: int = JOINTS, count: int = COUNT) -> bytes:
    with tempfile.TemporaryDirectory() as home:
        suffix = {"bag": ".bag", "db3": "", "mcap": "_mcap"}[name.rpartition(".")[2]]
        path = write(Path(home) / f"log{suffix}", messages(joints, count), compression=BAGS[name])
        if path.is_dir():
            [path] = [file for file in path.iterdir() if file.suffix != ".yaml"]
        return checked(path.read_bytes()) if name in CHECKED else path.read_bytes()


@cache
def truth(name: str, joints: int = JOINTS, count: int = COUNT):
    log, samples = read(bag(name, joints, count), name)
    assert not log.warnings
    assert {len(x) for x in samples.values()} == {count, count // 3}
    return samples


def is_prefix_or_refused(content: bytes, name: str) -> tuple[int, list[str]]:
    """Number of messages that are read; 0 where the bag is refused."""
    try:
        log, samples = read(content, name)
    except BadLog:
        return 0, []
    expected = truth(name)
    for channel, values in samples.items():
        before = expected[channel]
        shift = 0.0
        if channel.endswith(("/stamp", "/received")) and len(values):
            shift = before[0] - values[0]  # times count from the first message
        if not shift:  # a tenth of the time of what follows
            assert np.array_equal(values, before[: len(values)], equal_nan=True), channel
        else:
            np.testing.assert_allclose(values + shift, before[: len(values)], rtol=0, atol=1e-9)
    counts = {name.rpartition("/")[0]: len(values) for name, values in samples.items()}
    return sum(counts.values()), log.warnings if sum(counts.values()) < COUNT * 4 // 3 else ["whole"]


@pytest.mark.parametrize("name", BAGS)
@pytest.mark.parametrize("count", [40, pytest.param(100, marks=pytest.mark.slow)])
def test_of_a_bag_that_is_cut_anywhere_the_messages_before_are_read_and_counted(name, count):
    """Once at random in each of so many parts of equal length."""
    content, random = bag(name), np.random.default_rng(count)
    shares = []
    for length in ((np.arange(count) + random.random(count)) / count * len(content)).astype(int):
        number, warnings = is_prefix_or_refused(content[:length], name)
        if number:
            assert any("cut" in warning and str(number) in warning for warning in warnings) or warnings == ["whole"]
        shares.append(number / (COUNT * 4 / 3) / (length / len(content)))
    assert np.median(shares) > 0.7


@pytest.mark.parametrize("name", CHECKED)
@pytest.mark.parametrize("count", [100, pytest.param(1000, marks=pytest.mark.slow)])
def test_of_a_bag_with_checksums_no_damage_is_read(name, count):
    content, random = bag(name), np.random.default_rng(count)
    numbers = [is_prefix_or_refused(damaged(content, random), name)[0] for _ in range(count)]
    assert sum(number == 0 for number in numbers) > count / 2


@pytest.mark.parametrize("name", ["log.bag", "bz2.bag", "log.db3", "log.mcap"])
@pytest.mark.parametrize("count", [20, pytest.param(150, marks=pytest.mark.slow)])
def test_damage_of_any_other_bag_is_refused_or_changes_no_more_than_what_it_hit(name, count):
    """But of lz4 and zstd without checksums, which unpack to something else in silence."""
    content, random = bag(name, MANY, FEW), np.random.default_rng(count)
    for _ in range(count):
        try:
            _, samples = read(damaged(content, random), name)
        except BadLog:
            continue
        for channel, values in samples.items():
            if channel.endswith("]") and channel in truth(name, MANY, FEW) and len(values) == FEW:
                assert np.count_nonzero(values != truth(name, MANY, FEW)[channel]) <= FEW // 50


@pytest.mark.parametrize("name", ["lz4.bag", "bz2.bag"])
def test_a_compressed_chunk_of_another_size_or_of_other_bytes_is_refused(name):
    content = bag(name)
    chunk = content.index(b"op=\x05")
    place = content.index(b"size=", chunk) + 5
    [size] = struct.unpack_from("<I", content, place)
    for wrong in (size - 1, size + 1):
        resized = content[:place] + struct.pack("<I", wrong) + content[place + 4 :]
        with pytest.raises(BadLog, match=f"a chunk holds {size} bytes instead of {wrong}"):
            read(resized, name)
    start = content.index({"lz4.bag": b"\x04\x22\x4d\x18", "bz2.bag": b"BZh"}[name], chunk)
    with pytest.raises(BadLog, match="a chunk cannot be decompressed"):
        read(content[:start] + b"?" + content[start + 1 :], name)


def test_a_bag_of_ros_1_without_an_index_is_read_whole_and_said_to_be_so(tmp_path):
    content = bag("log.bag")
    index = content.index(b"index_pos=") + len(b"index_pos=")
    [place] = struct.unpack_from("<Q", content, index)
    for size in (len(content), place):  # as after a crash, the second without the index itself
        log, samples = read(content[:index] + bytes(8) + content[index + 8 : size], "log.bag")
        assert log.cut
        [warning] = log.warnings
        assert "1200 messages over 8.990 s are whole and are read" in warning
        for channel, values in samples.items():
            assert_array_equal(values, truth("log.bag")[channel])


def test_a_folder_without_its_description_is_read_whole(tmp_path):
    for name in ("log", "log_mcap"):
        path = write(tmp_path / name, messages())
        _, expected = whole(path)
        (path / "metadata.yaml").unlink()
        log, samples = whole(path)
        assert "no metadata.yaml describes" in log.warnings[0]
        for channel, values in samples.items():
            assert_array_equal(values, expected[channel])


def test_a_folder_with_fewer_messages_than_its_description_counts_is_remarked_on(tmp_path):
    path = write(tmp_path / "log", messages())
    metadata = path / "metadata.yaml"
    metadata.write_text(metadata.read_text().replace("message_count: 1200", "message_count: 1300"))
    assert "counts 1300 messages, but its files hold 1200" in open_log(path).warnings[0]


@pytest.mark.parametrize("compression", ["message", "file"])
def test_compressed_messages_and_files_are_those_that_were_written(compression, tmp_path):
    for name in ("log", "log_mcap"):
        _, samples = whole(write(tmp_path / name, messages(), compression=compression))
        for channel, values in samples.items():
            assert_array_equal(values, truth("log.db3")[channel])
        shutil.rmtree(tmp_path / name)


def test_a_wrong_checksum_and_a_wrong_count_are_named():
    content = bytearray(bag("checked.mcap"))
    content[len(content) // 2] ^= 1
    with pytest.raises(BadLog, match="the checksum of a chunk does not match"):
        read(bytes(content), "log.mcap")
    content = bytearray(bag("log.mcap"))
    [statistics] = [begin for kind, begin, _ in records(bytes(content), MAGIC) if kind == 11]
    struct.pack_into("<Q", content, statistics + 48, COUNT + 7)
    with pytest.raises(BadLog, match="its statistics counts 907 messages of /PSM1/measured_js, but 900 are there"):
        read(bytes(content), "log.mcap")
    struct.pack_into("<I", content, statistics + 42, 0)  # whose counts of topics may be left out
    struct.pack_into("<Q", content, statistics, 1234)
    with pytest.raises(BadLog, match="counts 1234 messages of all topics, but 1200 are there"):
        read(bytes(content), "log.mcap")
    struct.pack_into("<Q", content, statistics, 1200)
    assert not read(bytes(content), "log.mcap")[0].warnings
    content = bytearray(bag("log.bag"))
    info = content.rindex(b"count=")
    content[info + 14] ^= 1  # of the messages of a topic in the last chunk
    with pytest.raises(BadLog, match="its index counts"):
        read(bytes(content), "log.bag")


def test_mcap_without_chunks_and_without_a_summary_is_read():
    content, data = bag("log.mcap"), b""
    for kind, begin, end in records(content, MAGIC):
        if kind == 1:
            data += content[begin - 9 : end]
        elif kind == 6:
            data += content[begin + 28 + 4 + 8 : end]
    data = content[:MAGIC] + data + struct.pack("<BQI", 15, 4, 0) + struct.pack("<BQQQI", 2, 20, 0, 0, 0)
    for ending in (content[:MAGIC], b""):
        log, samples = read(data + ending, "log.mcap")
        assert log.cut == (not ending)
        for channel, values in samples.items():
            assert_array_equal(values, truth("log.mcap")[channel])


def test_the_open_chunk_of_a_recorder_that_crashed_is_read():
    """The recorder of ROS 1 writes the size of a chunk when it closes it; until then it is 0."""
    content = bag("log.bag")
    at, crashed = len(b"#ROSBAG V2.0\n"), b""
    while at < len(content):
        header = struct.unpack_from("<I", content, at)[0]
        length = struct.unpack_from("<I", content, at + 4 + header)[0]
        end = at + 8 + header + length
        if b"op=\x03" in content[at : at + header]:
            index = content.index(b"index_pos=", at) + len(b"index_pos=")
            crashed += content[:index] + bytes(8) + content[index + 8 : end]
        elif b"op=\x05" in content[at : at + 4 + header]:
            sizes = content[at : at + 4 + header]
            place = sizes.index(b"size=") + 5
            data = content[at + 8 + header : end]
            crashed += sizes[:place] + bytes(4) + sizes[place + 4 :] + bytes(4) + data
        at = end
    log, samples = read(crashed[:-1000], "log.bag")
    assert "is cut" in log.warnings[0]
    for channel, values in samples.items():
        assert len(values) > 0.99 * len(truth("log.bag")[channel]) - 2
        assert_array_equal(values, truth("log.bag")[channel][: len(values)])
