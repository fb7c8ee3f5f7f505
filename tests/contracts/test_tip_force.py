"""The force at the tip of a study that went through every stage, against what was pushed."""

import numpy as np

from davinci_forces.records import TipContact
from tests.contracts.conftest import TRUTH, Lab


def test_a_force_that_was_pushed_is_within_its_stated_interval(lab: Lab):
    """Logs of 50 Hz, of parameters that were fitted to others."""
    [push] = TRUTH["log"][1]["push"]
    [contact] = lab.records(TipContact)
    assert list(contact.stated) == [1]
    true = push["peak"] * np.array(push["direction"])
    for name, component in zip(("f_x", "f_y", "f_z"), true, strict=True):
        std = getattr(contact, f"{name}_std")[0]
        assert abs(getattr(contact, name)[0] - component) < 1.96 * std, name
        assert std < 0.3 * push["peak"]
