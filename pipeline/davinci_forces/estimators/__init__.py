"""How parameters are found: one module per estimator, exporting `estimate` and its title, `NAME`, and listed below."""

from importlib import import_module

from davinci_forces.estimators.problem import Estimator

ESTIMATORS = ("lse", "wlse", "pso", "bounded", "prior", "huber", "iv", "tls", "consistent")


def estimator(name: str) -> Estimator:
    """The estimator of that name."""
    found: Estimator = import_module(f"davinci_forces.estimators.{name}").estimate
    return found


def title_of(name: str) -> str:
    """The title of the estimator of that name, as `least squares`; the name itself where there is none."""
    return str(import_module(f"davinci_forces.estimators.{name}").NAME) if name in ESTIMATORS else name
