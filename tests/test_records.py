"""What all records have in common, and records read back: whole, or column by column where they are long."""

from dataclasses import FrozenInstanceError, replace
from types import SimpleNamespace

import numpy as np
import pytest

from davinci_forces.errors import BadRecord
from davinci_forces.records import KINDS, PeriodResidual, by_name, store

ROWS = 1000


@pytest.fixture
def written(tmp_path):
    """A folder with a record in it, and where in the folder that is."""
    rng = np.random.default_rng(1)
    t, q, dq, tau = np.arange(1.0 * ROWS), *rng.standard_normal((3, ROWS))
    record = PeriodResidual("log", "joint", t=t, q_noise=q, dq_noise=dq, tau_noise=tau)
    with store.Writer(tmp_path, lambda record: lambda template: template, {}) as writer:
        return tmp_path, writer.write(record), record


@pytest.mark.parametrize("kind", KINDS.values())
def test_every_record_is_frozen_and_equals_itself_alone(kind):
    """Its columns are arrays, which have no one truth to compare by."""
    with pytest.raises(FrozenInstanceError):
        setattr(object.__new__(kind), kind.KEY[0], "another")
    assert kind.__eq__ is object.__eq__


def test_a_long_record_holds_no_column_and_has_them_all(written):
    folder, place, record = written
    whole, later = (
        store.read(PeriodResidual, folder, place),
        store.read(PeriodResidual, folder, place, longest=ROWS - 1),
    )
    assert {"t", "tau_noise"} <= set(vars(whole))
    assert not {"t", "tau_noise"} & set(vars(later))
    for name in record.columns():
        np.testing.assert_array_equal(getattr(later, name), getattr(record, name))
    assert not {"t", "tau_noise"} & set(vars(later))
    assert (later.key, len(later), later.origin) == (whole.key, ROWS, whole.origin)
    assert "tau_noise" in vars(store.read(PeriodResidual, folder, place, longest=ROWS))


def test_what_a_long_record_has_not_is_no_attribute(written):
    folder, place, _ = written
    later = store.read(PeriodResidual, folder, place, longest=1)
    with pytest.raises(AttributeError, match="tau_hat"):
        _ = later.tau_hat  # type: ignore[attr-defined]


def test_a_column_of_a_long_record_that_is_gone_is_said_when_it_is_asked_for(written):
    folder, place, _ = written
    later = store.read(PeriodResidual, folder, place, longest=1)
    (folder / place).write_bytes(b"PAR1")
    with pytest.raises(BadRecord, match=r"joint\.parquet: not a PeriodResidual"):
        _ = later.tau_noise


def test_a_record_takes_what_is_not_given_from_the_first_source_that_has_it(written):
    folder, place, record = written
    later = store.read(PeriodResidual, folder, place, longest=1)
    first = SimpleNamespace(joint="another", q_noise=np.zeros(ROWS), unit="m")
    for source in (record, later):
        made = PeriodResidual.like(first, source, tau_noise=np.ones(ROWS))
        assert (made.log, made.joint) == ("log", "another")
        np.testing.assert_array_equal(made.q_noise, np.zeros(ROWS))
        np.testing.assert_array_equal(made.dq_noise, record.dq_noise)
        np.testing.assert_array_equal(made.tau_noise, np.ones(ROWS))


def test_records_are_grouped_in_the_order_in_which_names_first_occur(written):
    _, _, record = written
    again = replace(record, log="b"), replace(record, log="a"), replace(record, log="b")
    assert by_name(again, "log") == {"b": [again[0], again[2]], "a": [again[1]]}
    assert list(by_name(again, "log")) == ["b", "a"]
