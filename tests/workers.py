"""How Dask starts workers in the tests: forked from one process that has imported what they need.

Each would import it all itself otherwise, which takes longer than most of what is tested.
"""

from __future__ import annotations

import pytest

dask = pytest.importorskip("dask")
distributed = pytest.importorskip("distributed")

NEEDED = ["distributed.worker", "distributed.nanny", "pathcontrol.sweeps.chunk", "pathcontrol.analysis.run_metrics"]

dask.config.set({"distributed.worker.multiprocessing-method": "forkserver"})
distributed.utils.get_mp_context().set_forkserver_preload(NEEDED)  # after what Dask itself asks for, instead of it
