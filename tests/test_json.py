"""Any nesting of plain values and arrays can be written as strict JSON, and is read back as it was."""

from __future__ import annotations

import json
import math

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from pathcontrol._json import to_json

PLAIN = st.recursive(
    st.none() | st.booleans() | st.integers(-(2**40), 2**40) | st.floats() | st.text(max_size=5),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=5), inner, max_size=4),
    max_leaves=12,
)


def with_nulls(value):
    if isinstance(value, dict):
        return {key: with_nulls(item) for key, item in value.items()}
    if isinstance(value, list):
        return [with_nulls(item) for item in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


@given(PLAIN)
def test_plain_values_come_back_with_null_for_what_is_not_finite(value):
    assert json.loads(json.dumps(to_json(value), allow_nan=False)) == with_nulls(value)


@given(st.lists(st.floats(), min_size=1, max_size=6))
def test_arrays_tuples_and_numbers_of_numpy_are_as_lists_and_numbers(numbers):
    array = np.array(numbers)
    assert to_json(array) == to_json(tuple(numbers)) == to_json([np.float64(one) for one in numbers])
    assert to_json(array.reshape(1, -1)) == [with_nulls(numbers)]
