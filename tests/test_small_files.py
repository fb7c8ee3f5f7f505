"""Small files that would cost minutes or gigabytes: refused in words before they are parsed, or read in pieces."""

import json
import os
import subprocess
import sys
from pathlib import Path

import h5py
import numpy as np
import pytest

from davinci_forces.errors import BadStudy
from davinci_forces.study import reading
from davinci_forces.toml.lines import MAX_TABLES, MOST_PROBLEMS
from tests.logs.array_writers import SIGNATURE

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="what a process took is told by POSIX")

REFUSES = 2.0  # [s] of computing
MOST_MEMORY = 500  # [MB]
PATIENCE = 60  # [s] of computing, after which the system ends what is far too slow
READS_HDF5 = 60.0  # [s] of computing

LOG = """
[[log]]
name = "log-{0}"
file = "log.tdms"
role = "identification"
period = 10.0
skip = 10.0
[log.channels]
time = "Motors/Time"
"hand_roll.theta_m" = {{ channel = "Motors/Roll motor angle", unit = "rad" }}
"hand_roll.dtheta_m" = {{ channel = "Motors/Roll motor speed", unit = "rad/s" }}
"hand_roll.i" = {{ channel = "Motors/Roll current", unit = "A" }}
"""

# What a file holds, and what is said of it.
STUDIES = {
    "dots": (".".join("a" * 50_000) + " = 1", "toml:1: it has more than 16 names"),
    "dots of a table": ("[" + ".".join("a" * 50_000) + "]", "toml:1: it has more than 16 names"),
    "dots, often": ("".join(f"a{i}.b.c.d.e.f.g.h = 1\n" for i in range(150_000)), "it has more than 800000 names, val"),
    "keys": ("".join(f"k{i} = 1\n" for i in range(330_000)), "toml:266667: it has more than 800000 names, values"),
    "logs": ('[[log]]\nname = "a"\n' * 85_000, f"toml:20001: it has more than {MAX_TABLES} [[tables]]"),
    "lists": (("a = " + "[" * 100 + "]" * 100 + "\n") * 15_000, "toml:1: it has more than 16 names and brackets"),
    "inline tables": ("a = " + "{a = " * 80 + "1" + "}" * 80, "toml:1: it has more than 16 names and brackets"),
    "numbers": ("a = [" + "1," * 1_900_000 + "]", "toml:1: it has more than 800000 names, values and marks"),
    "digits": ("a = 1." + "1" * 3_900_000, "toml:1: it has more than 10000 characters in one name or number"),
    "marks": ("=" * 3_900_000, "toml:1: it has more than 800000 names, values and marks"),
    "quotes": ('a = "' + '\\"' * 1_900_000, "toml:1: it has more than 100000 characters in one text"),
    "wrong keys": ("".join(f"k{i} = 1\n" for i in range(10_000)), "9802 more problems"),
}


def took(*arguments: str) -> tuple[float, float, str]:
    """CPU time [s] and peak memory [MB] of a process and its children, and what it says."""
    import resource

    def limited() -> None:
        resource.setrlimit(resource.RLIMIT_CPU, (PATIENCE, PATIENCE))
        if sys.platform == "linux":
            resource.setrlimit(resource.RLIMIT_DATA, (2 << 30, 2 << 30))

    measuring = (
        "import resource, subprocess, sys\n"
        "said = subprocess.run([sys.executable, *sys.argv[1:]], stdout=subprocess.PIPE, stderr=subprocess.STDOUT)\n"
        "used = resource.getrusage(resource.RUSAGE_CHILDREN)\n"
        "print(used.ru_utime + used.ru_stime, used.ru_maxrss, flush=True)\n"
        "sys.stdout.buffer.write(said.stdout)\n"
    )
    said = subprocess.run(
        [sys.executable, "-c", measuring, *arguments], capture_output=True, check=True, preexec_fn=limited,
        env=os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)},
    ).stdout.decode()  # fmt: skip
    numbers, _, text = said.partition("\n")
    seconds, most = map(float, numbers.split())
    return seconds, most / (1 << 20 if sys.platform == "darwin" else 1 << 10), text


# A process that answers commands, each in a child that has the package loaded.
SERVE = """
import json, sys
from importlib import import_module
from pathlib import Path
from tests.odd_files import run

for name in ("davinci_forces.cli", "davinci_forces.runner.runs", "davinci_forces.runner.runner", "typer._adapters"):
    import_module(name)
for line in sys.stdin:
    print(json.dumps(run(Path(), json.loads(line))), flush=True)
"""


@pytest.fixture(scope="module")
def refused_soon():
    """What checks that a command is refused: soon, in little memory, and in words that it is given."""
    with subprocess.Popen(
        [sys.executable, "-c", SERVE], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
        cwd=Path(__file__).parents[1],
    ) as server:  # fmt: skip

        def check(says: str, *arguments: str) -> None:
            server.stdin.write(json.dumps(arguments) + "\n")
            server.stdin.flush()
            answer = json.loads(server.stdout.readline())
            assert says in answer["said"]
            assert "Traceback" not in answer["said"]
            assert len(answer["said"]) < 100_000
            assert answer["seconds"] < REFUSES
            assert answer["memory"] / 1024 < MOST_MEMORY

        yield check
        server.stdin.close()


@pytest.mark.parametrize("what", STUDIES)
def test_a_study_that_would_cost_minutes_is_refused_in_words(tmp_path, refused_soon, what):
    content, says = STUDIES[what]
    (tmp_path / "study.toml").write_text(content)
    refused_soon(says, "all", str(tmp_path), "--dry-run")


@pytest.mark.medium
def test_a_study_of_as_many_logs_as_may_be_is_read(tmp_path):
    text = 'robot = "davinci"\n' + "".join(LOG.format(i) for i in range(MAX_TABLES))
    (tmp_path / "study.toml").write_text(text)
    (tmp_path / "log.tdms").touch()
    assert len(reading.read(tmp_path).logs) == MAX_TABLES
    (tmp_path / "study.toml").write_text(text + LOG.format("more"))
    with pytest.raises(BadStudy, match=rf"it has more than {MAX_TABLES} \[\[tables\]\]"):
        reading.read(tmp_path)


def test_of_many_problems_the_first_are_said_and_the_others_counted(tmp_path):
    (tmp_path / "study.toml").write_text("".join(f"k{i} = 1\n" for i in range(1000)))
    with pytest.raises(BadStudy) as caught:
        reading.read(tmp_path)
    *said, last = str(caught.value).splitlines()
    assert len(said) == MOST_PROBLEMS
    assert "unknown key 'k0'" in said[2]
    assert last.endswith(f"study.toml: {1002 - MOST_PROBLEMS} more problems; correct these first")


def test_a_robot_of_thousands_of_joints_is_refused(tmp_path, refused_soon):
    joint = '[[joint]]\nname = "j{}"\nkind = "revolute"\nterms = ["inertia"]\n'
    link = '[[link]]\nname = "l{0}"\na = 0.1\nmoved_by = "j{0}"\nmass = 1.0\n'
    (tmp_path / "arm.toml").write_text("".join(each.format(i) for each in (joint, link) for i in range(4000)))
    refused_soon("arm.toml:801: it has 4000 [[joint]], more than the 200", "robot", str(tmp_path / "arm.toml"))


def urdf_chain(joints: int, kind: str) -> str:
    links = ['<robot name="r">', '<link name="l0"/>']
    for i in range(1, joints + 1):
        links.append(
            f'<link name="l{i}"><inertial><mass value="1"/></inertial></link><joint name="j{i}" type="{kind}">'
            f'<parent link="l{i - 1}"/><child link="l{i}"/><axis xyz="1 0 0"/><origin xyz="0 0 1"/></joint>'
        )
    return "\n".join([*links, "</robot>"])


@pytest.mark.parametrize(
    ("content", "says"),
    [
        (urdf_chain(3000, "continuous"), "arm.urdf:1002: it has more than 1000 links"),
        (urdf_chain(201, "continuous"), "it has 201 moving joints, more than the 200 allowed"),
        (urdf_chain(3000, "fixed"), "arm.urdf:1002: it has more than 1000 links"),
        ("<robot>" + "<a>" * 500_000 + "</a>" * 500_000 + "</robot>", "more than 30 nested elements"),
        ("<robot>" + "<a/>" * 900_000 + "</robot>", "arm.urdf:1: it has more than 30000 elements"),
        ("<robot " + " ".join(f'a{i}="1"' for i in range(300_000)) + "/>", "more than 30 attributes in an element"),
        (f'<robot><link name="{"x" * 3_900_000}"/></robot>', "arm.urdf:1: <link name='xxx"),
    ],
)
def test_a_urdf_that_would_cost_minutes_is_refused_in_words(tmp_path, refused_soon, content, says):
    (tmp_path / "arm.urdf").write_text(content)
    refused_soon(says, "robot", str(tmp_path / "arm.urdf"))


READ = (
    "import sys\n"
    "from pathlib import Path\n"
    "from davinci_forces import logs\n"
    "log = logs.open_log(Path(sys.argv[1]))\n"
    "rows, total = 0, 0.0\n"
    "for block in log.blocks(['time', 'x']):\n"
    "    rows, total = rows + len(block['x']), total + float((block['time'] * block['x']).sum())\n"
    "print(len(log.channels), rows, repr(total))\n"
)


def assert_read(path, channels: int, rows: int, total: float, limit: float = READS_HDF5) -> None:
    seconds, memory, text = took("-c", READ, str(path))
    assert seconds < limit
    assert memory < MOST_MEMORY
    assert [float(word) for word in text.split()] == pytest.approx([channels, rows, total], rel=1e-12), text


@pytest.mark.parametrize("kind", ["variables", "cells"])
@pytest.mark.slow
def test_a_matlab_file_of_thousands_of_small_arrays_is_read(tmp_path, kind):
    """Of 15 000 cells the first 1000 are taken in; what is read are two variables beside them."""
    path, count, t = tmp_path / "log.mat", 15_000, np.arange(100.0)
    with h5py.File(path, "w", userblock_size=512, libver="latest") as file:
        group = file.create_group("#refs#" if kind == "cells" else "s")
        names, space = [f"v{i}".encode() for i in range(count)], h5py.h5s.create_simple((1, 3))
        for name in names:  # by the library's own functions, which take a fifth of the time
            h5py.h5d.create(group.id, name, h5py.h5t.IEEE_F64LE, space).write(h5py.h5s.ALL, h5py.h5s.ALL, t[:3])
        if kind == "cells":
            cell = file.create_dataset("c", (1, count), h5py.ref_dtype)
            cell.attrs["MATLAB_class"] = np.bytes_("cell")
            cell[0] = [h5py.h5r.create(group.id, name, h5py.h5r.OBJECT) for name in names]
        for name in ("time", "x"):
            file.create_dataset(name, data=t[None])
    with path.open("r+b") as file:
        file.write(SIGNATURE.ljust(124) + b"\0\2IM")
    assert_read(path, 2 + (1000 if kind == "cells" else count), len(t), float((t * t).sum()), READS_HDF5 / 3)


@pytest.mark.slow
def test_chunks_of_128_MB_are_unpacked_once(tmp_path):
    """Two channels of one and a quarter chunk each."""
    chunk, path = 1 << 24, tmp_path / "log.h5"
    x = np.arange(chunk + chunk // 4) % 1000.0
    with h5py.File(path, "w") as file:
        for name in ("time", "x"):
            file.create_dataset(name, data=x, chunks=(chunk,), compression="gzip", compression_opts=1)
    assert_read(path, 2, len(x), float((x * x).sum()))


@pytest.mark.parametrize("shape", [(7000,), (7000, 3), (1, 7000)])
@pytest.mark.parametrize("kind", ["<f8", ">i4", "u1"])
def test_a_chunk_unpacked_piece_by_piece_holds_the_same_samples(tmp_path, monkeypatch, shape, kind):
    from davinci_forces.logs.hdf5 import datasets

    monkeypatch.setattr(datasets, "CACHE", 100)
    monkeypatch.setattr(datasets, "UNPACK_BYTES", 77)
    values = np.random.default_rng(0).integers(0, 200, shape).astype(kind)
    chunks = tuple(length if length < 7000 else 3000 for length in shape)
    axis = int(np.argmax(shape))
    with h5py.File(tmp_path / "log.h5", "w") as file:
        plain = file.create_dataset("x", data=values, chunks=chunks, compression="gzip")
        shuffled = file.create_dataset("y", data=values, chunks=chunks, compression="gzip", shuffle=True)
        assert isinstance(datasets._opened(file, plain.ref, axis), datasets.Unpacked)
        assert isinstance(datasets._opened(file, shuffled.ref, axis), h5py.Dataset)
    log = datasets.open_in_child(tmp_path / "log.h5")
    for _ in range(2):  # from the start again, too
        blocks = list(log.blocks([channel.name for channel in log.channels]))
        columns = [np.concatenate([block[c.name] for block in blocks]) for c in log.channels]
        each = values.reshape(7000, -1).T
        assert np.array_equal(columns, np.concatenate([each, each]).astype(float))
