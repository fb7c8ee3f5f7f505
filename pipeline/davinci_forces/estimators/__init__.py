"""How parameters are found: one module per estimator, exporting `estimate`, and its name in the list below."""

from importlib import import_module

from davinci_forces.estimators.problem import Estimator

ESTIMATORS = ("lse", "wlse", "pso", "bounded", "prior", "huber", "iv", "tls", "consistent")


def estimator(name: str) -> Estimator:
    """The estimator of that name."""
    found: Estimator = import_module(f"davinci_forces.estimators.{name}").estimate
    return found
