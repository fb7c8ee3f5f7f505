"""What reading a log loads, which takes longer than reading a short one."""

import subprocess
import sys
from pathlib import Path

import pytest

from tests import arm
from tests.logs.tdms_writer import segment

CODE = """
import sys
import davinci_forces
assert davinci_forces.run(sys.argv[1], "ingest", quiet=True)
print(*sorted({"numba", "pandas", "scipy"} & set(sys.modules)))
"""


@pytest.mark.parametrize("format", ["csv", "tdms"])
def test_reading_a_log_loads_no_compiler_no_solver_and_no_data_frames(tmp_path: Path, format: str):
    signal = arm.signal(periods=2, rate=50.0)
    folder, file = tmp_path / "raw" / "lab", f"log.{format}"
    arm.write_csv(folder / "log.csv", [signal])
    columns = {"time": signal.t, "hand_roll.q": signal.q, "hand_roll.dq": signal.dq, "hand_roll.tau": signal.tau}
    (folder / "log.tdms").write_bytes(segment({f"g/{name}": values for name, values in columns.items()}))
    table = arm.log_table("log", file, "validation", ["hand_roll"])
    (folder / "study.toml").write_text(f'robot = "dvrk_psm"\n{table}')
    done = subprocess.run([sys.executable, "-c", CODE, folder], capture_output=True, text=True, check=True)
    assert done.stdout.splitlines()[-1] == ""
