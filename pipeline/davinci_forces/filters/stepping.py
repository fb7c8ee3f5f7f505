"""The step of the extended Kalman filter compiled, and how recordings and noise enter the compiled passes."""

from collections.abc import Callable
from types import FunctionType
from typing import Any

import numpy as np

from davinci_forces.filters import sample
from davinci_forces.filters.problem import FilterInput, NoiseModel
from davinci_forces.filters.sample import first
from davinci_forces.maths.compiled import compile_function


def _compile(function: Callable[..., Any], **calls: Any) -> Any:
    """Compile a function with the compiled functions that it calls."""
    assert isinstance(function, FunctionType)
    return compile_function(FunctionType(function.__code__, {**function.__globals__, **calls}, function.__name__))


sign = compile_function(sample.sign)
bias = _compile(sample.bias, sign=sign)
transition = _compile(sample.transition, bias=bias, sign=sign)
gains = compile_function(sample.gains)
correct = _compile(sample.correct, gains=gains)
predict = compile_function(sample.predict)


def arguments(recording: FilterInput, noise: NoiseModel) -> tuple[Any, ...]:
    """Return a recording and its noise as the compiled passes take them."""
    before = first(float(recording.q[0]), float(recording.dq[0]), noise.r_q, noise.r_dq, recording.initial_std)
    return (before, *columns(recording), *covariances(noise, recording.T_s))


def columns(recording: FilterInput) -> tuple[Any, ...]:
    """Return position, velocity, drive and inertia (N,) of a recording, the coefficients of its bias, and T_s."""
    joint = recording.joint
    samples = (recording.q, recording.dq, recording.tau - joint.known, joint.inertia)
    return (*(np.ascontiguousarray(x, float) for x in samples), joint.coefficients, recording.T_s)


def covariances(noise: NoiseModel, T_s: float) -> tuple[float, float, float, float, float, float]:
    """Return R of q and dq, and Q: of q, the covariance of q and dq, of dq, and of the external effort."""
    r_q, r_dq, q_q, q_dq, q_tau = map(float, noise)
    return r_q**2, r_dq**2, q_q**2 + (0.5 * T_s * q_dq) ** 2, 0.5 * T_s * q_dq**2, q_dq**2, q_tau**2
