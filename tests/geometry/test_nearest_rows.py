"""The nearest of many points, against a search tree and all distances."""

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
    with pytest.MonkeyPatch.context() as patch:  # by the tree, or by all distances
        patch.setattr(module, "_PAIRS", pairs)
        rows = module.nearest_rows(x, points)
    assert rows.shape == (k,)
    assert np.linalg.norm(x - points[rows], axis=-1) == pytest.approx(cKDTree(points).query(x)[0], rel=1e-12)


@given(
    st.integers(1, 70), st.integers(1, 200), st.integers(1, 4), st.sampled_from([0, 1, 8]), st.integers(0, 2**32 - 1)
)
def test_boxes_find_the_first_of_the_nearest(k, t, m, digits, seed):
    """On curves, and with numbers of few digits among many points that are as near as another."""
    rng = np.random.default_rng(seed)
    x, points = (np.cumsum(rng.normal(size=(rows, m)), axis=0).round(digits) for rows in (k, t))
    nearest = ((x[:, None] - points) ** 2).sum(-1).argmin(-1)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(module, "_FEW", 0)
        assert (module.nearest_rows(x, points) == nearest).all()
