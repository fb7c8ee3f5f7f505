"""An export in C, compiled as each compiler takes it, and called from Python."""

import ctypes
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

FLAGS = ("-Wall", "-Wextra", "-Werror", "-pedantic", "-O2")
AS_C, AS_CPP = ("-std=c99",), ("-std=c++11", "-x", "c++")
COMPILERS = {"gcc": AS_C, "clang": AS_C, "g++": AS_CPP, "clang++": AS_CPP}
OK, OUTSIDE, BAD = range(3)


class CompiledModel:
    """The functions of an export in C; `restart` clears the state of a joint."""

    def __init__(self, files: dict[str, str], folder: Path) -> None:
        for name, text in files.items():
            (folder / name).write_text(text)
        compilers = [name for name in COMPILERS if shutil.which(name)]
        if not compilers:
            pytest.skip("no C compiler is installed, so that the exported C is not compiled")
        for name in reversed(compilers):
            command = [name, *COMPILERS[name], *FLAGS, "-shared", "-fPIC", "model.c", "-o", "model.so", "-lm"]
            subprocess.run(command, cwd=folder, check=True)
        n = int(files["model.h"].partition("DF_COORDINATES = ")[2].partition(",")[0])
        z = int(files["model.h"].partition("DF_STATES = ")[2].partition(" ")[0])
        self.library, number = ctypes.CDLL(str(folder / "model.so")), ctypes.c_double
        self.State = structure(runs=ctypes.c_int, t=number, z=number * z, x=number * 9)
        of_joint = dict.fromkeys(("t", "tau", "q_measured", "dq_measured"), number)
        self.Sample = structure(**of_joint, **dict.fromkeys(("q", "dq", "ddq"), number * n))
        self.Result = structure(
            **dict.fromkeys(("tau_hat", "tau_ext", "std_filter", "std"), number), contact=ctypes.c_int
        )
        self.restart()

    def restart(self) -> None:
        self.state, self.result = self.State(), self.Result()

    def step(self, joint: int, t, tau, q_measured, dq_measured, q, dq, ddq) -> int:
        columns = [(ctypes.c_double * len(x))(*x) for x in (q, dq, ddq)]
        sample = self.Sample(t, tau, q_measured, dq_measured, *columns)
        return self.library.df_step(joint, *map(ctypes.byref, (self.state, sample, self.result)))

    def call(self, name: str, joint: int, *motion, state=False) -> tuple[int, float]:
        columns, out = [(ctypes.c_double * len(x))(*x) for x in motion], ctypes.c_double(np.nan)
        states = [ctypes.byref(self.state)] if state else []
        return getattr(self.library, f"df_{name}")(joint, *states, *columns, ctypes.byref(out)), out.value


def structure(**fields) -> type:
    return type("Fields", (ctypes.Structure,), {"_fields_": list(fields.items())})
