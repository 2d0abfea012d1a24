"""The nearest of many points, against a search tree."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import cKDTree

from pathcontrol.geometry import nearest_rows as module


@pytest.mark.parametrize("pairs", [0, 10**9])
@given(st.integers(1, 60), st.integers(1, 60), st.integers(1, 7), st.integers(0, 2**32 - 1))
@settings(max_examples=30, deadline=None)
def test_no_point_is_nearer(pairs, k, t, m, seed):
    rng = np.random.default_rng(seed)
    x, points = rng.normal(size=(k, m)), rng.normal(size=(t, m))
    with pytest.MonkeyPatch.context() as patch:  # by the tree, or by all distances in small blocks
        patch.setattr(module, "_PAIRS", pairs)
        patch.setattr(module, "_BLOCK", 100)
        rows = module.nearest_rows(x, points)
    assert rows.shape == (k,)
    assert np.linalg.norm(x - points[rows], axis=-1) == pytest.approx(cKDTree(points).query(x)[0], rel=1e-12)
