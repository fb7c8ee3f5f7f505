"""An export in C, compiled as each compiler takes it, and called from Python."""

import ctypes
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

from davinci_forces.exports import renderer
from davinci_forces.filters import tracker
from davinci_forces.filters.problem import filter_inputs
from davinci_forces.filters.response import noise_model
from davinci_forces.identification.joint_models import LogModels
from davinci_forces.records import FilterNoise, JointModel, Motion

FLAGS = ("-Wall", "-Wextra", "-Werror", "-pedantic", "-O2")
AS_C, AS_CPP = ("-std=c99",), ("-std=c++11", "-x", "c++")
COMPILERS = {"gcc": AS_C, "clang": AS_C, "g++": AS_CPP, "clang++": AS_CPP}
OK, OUTSIDE, BAD, OTHER_RATE = range(4)


class CompiledModel:
    """The functions of an export in C; `restart` clears the state of a joint."""

    def __init__(self, files: dict[str, str], folder: Path, floats: bool = False) -> None:
        for name, text in files.items():
            (folder / name).write_text(text)
        compilers = [name for name in COMPILERS if shutil.which(name)]
        if not compilers:
            pytest.skip("no C compiler is installed, so that the exported C is not compiled")
        if floats:  # in C only
            compilers = [name for name in compilers if COMPILERS[name] == AS_C]
        for name in reversed(compilers):
            command = [
                name,
                *COMPILERS[name],
                *FLAGS,
                *["-DDF_FLOAT"] * floats,
                "-shared",
                "-fPIC",
                "model.c",
                "-o",
                "model.so",
                "-lm",
            ]
            subprocess.run(command, cwd=folder, check=True)
        n = int(files["model.h"].partition("DF_COORDINATES = ")[2].partition(",")[0])
        z = int(files["model.h"].partition("DF_STATES = ")[2].partition(" ")[0])
        self.library, number = ctypes.CDLL(str(folder / "model.so")), ctypes.c_float if floats else ctypes.c_double
        self.number = number
        self.State = structure(
            runs=ctypes.c_int, t=ctypes.c_double, pace=ctypes.c_double, late=number, z=number * z, x=number * 9
        )
        of_joint = {"t": ctypes.c_double} | dict.fromkeys(("tau", "q_measured", "dq_measured"), number)
        self.Sample = structure(**of_joint, **dict.fromkeys(("q", "dq", "ddq"), number * n))
        self.Result = structure(
            **dict.fromkeys(("tau_hat", "tau_ext", "std_filter", "std"), number), contact=ctypes.c_int
        )
        self.restart()

    def restart(self) -> None:
        self.state, self.result = self.State(), self.Result()

    def step(self, joint: int, t, tau, q_measured, dq_measured, q, dq, ddq) -> int:
        columns = [(self.number * len(x))(*x) for x in (q, dq, ddq)]
        sample = self.Sample(t, tau, q_measured, dq_measured, *columns)
        return self.library.df_step(joint, *map(ctypes.byref, (self.state, sample, self.result)))

    def call(self, name: str, joint: int, *motion, state=False) -> tuple[int, float]:
        columns, out = [(self.number * len(x))(*x) for x in motion], self.number(np.nan)
        states = [ctypes.byref(self.state)] if state else []
        return getattr(self.library, f"df_{name}")(joint, *states, *columns, ctypes.byref(out)), out.value


def structure(**fields) -> type:
    return type("Fields", (ctypes.Structure,), {"_fields_": list(fields.items())})


def same_along_logs(export, folder: Path) -> int:
    """Compare the compiled model with every recorded log, as the study's filter sees it; return the samples."""
    compiled, samples, robot = CompiledModel(renderer("c")(export).files, folder), 0, export.study.robot
    for log in dict.fromkeys(m.log for m in export.catalogue.records(JointModel)):
        motions = export.catalogue.select(Motion, log=log)
        along = LogModels(export.identified, motions)
        for number, joint in enumerate(export.joints):
            for m in export.catalogue.select(JointModel, log=log, joint=joint.name):
                if m.stand_in or not np.isclose(m.rate, joint.filter["rate"], rtol=1e-12):
                    continue
                moved, columns = along.motion(joint.fit, joint.name), np.zeros((3, len(m), len(robot.joints)))
                for k, name in enumerate(joint.model.joints):
                    at = [j.name for j in robot.joints].index(name)
                    columns[:, :, at] = moved.q[:, k], moved.dq[:, k], moved.ddq[:, k]
                [tuned], q_tau = export.catalogue.select(FilterNoise, joint=joint.name), export.study.settings.q_tau
                noise = noise_model(tuned, joint.joint, 1.0 / m.rate, q_tau)
                start = joint.filter["initial_std"]
                passes = [tracker("ekf")(part._replace(initial_std=start), noise) for part in filter_inputs(m)]
                rows = []
                compiled.restart()
                for k in range(len(m)):
                    t = (k + 5 * m.segment[k]) / m.rate
                    status = compiled.step(number, t, m.tau[k], m.q_measured[k], m.dq_measured[k], *columns[:, k])
                    assert status != BAD
                    rows.append((compiled.result.tau_hat, compiled.result.tau_ext, compiled.result.std_filter))
                size = 1e-12 * np.abs(m.tau).max()
                expected = [
                    m.tau_hat,
                    *(np.concatenate([getattr(p, x) for p in passes]) for x in ("tau_ext", "tau_ext_std")),
                ]
                for ours, theirs in zip(np.transpose(rows), expected, strict=True):
                    assert_allclose(ours, theirs, rtol=0, atol=size, err_msg=f"{log}/{joint.name}")
                samples += len(m)
    return samples
