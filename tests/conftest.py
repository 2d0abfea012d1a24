"""Shared by all tests: the paper's arm and task, and how hypothesis searches."""

from __future__ import annotations

import gc
import os
import signal
from collections.abc import Callable, Iterator
from pathlib import Path

# matrices here are small: threads of BLAS would wait for each other, busily, on cores that other tests need
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
# what an array frees, the next one takes: glibc gives it back to the system otherwise, and asks for it page by page
os.environ.setdefault("MALLOC_MMAP_THRESHOLD_", str(1 << 25))  # bytes, the largest that it takes
os.environ.setdefault("MALLOC_TRIM_THRESHOLD_", str(1 << 30))

import numpy as np
import pytest
from experiment_files import BASE, DRAWING, OWN_TASK, document, merged
from hypothesis import HealthCheck, settings

from pathcontrol import Circle, RobotModel, Viscous, load_robot

slow = [HealthCheck.too_slow]
settings.register_profile("default", deadline=None, max_examples=25, derandomize=True, suppress_health_check=slow)
settings.register_profile("thorough", deadline=None, max_examples=500, suppress_health_check=slow)
settings.load_profile("default")

# tests press Ctrl-C, which a job in the background ignores, and all that it starts
signal.signal(signal.SIGINT, signal.default_int_handler)


@pytest.hookimpl(wrapper=True)
def pytest_collection() -> Iterator[None]:
    """What is collected stays to the end: the garbage collector need not look at it over and over."""
    gc.disable()
    try:
        return (yield)
    finally:
        gc.freeze()
        gc.set_threshold(50_000, 20, 20)
        gc.enable()


@pytest.hookimpl
def pytest_xdist_auto_num_workers(config: pytest.Config) -> int:
    """One more than there are cores: some tests wait, for a browser or for the clock of a robot."""
    return len(os.sched_getaffinity(0)) + 1


@pytest.fixture(scope="session")
def arm() -> RobotModel:
    """The CICESE arm with all its friction."""
    return load_robot("cicese_2dof")


@pytest.fixture(scope="session")
def ideal_arm(arm: RobotModel) -> RobotModel:
    """The same arm with viscous friction only, which the controllers compensate exactly."""
    return arm.with_friction(Viscous(arm.friction.viscous))


@pytest.fixture(scope="session")
def circle() -> Circle:
    """The paper's task."""
    return Circle(np.deg2rad(57.3), np.deg2rad(114.59))


@pytest.fixture
def write_experiment(tmp_path: Path) -> Callable[..., Path]:
    """A function that writes the base experiment with changes and gives the path."""

    def write(changes: dict | str | None = None, name: str = "experiment.toml") -> Path:
        path = tmp_path / name
        if isinstance(changes, str):
            path.write_text(changes, encoding="utf-8")
        else:
            data = merged(BASE, changes or {})
            path.write_text(document(data), encoding="utf-8")
        (tmp_path / "tasks.py").write_text(OWN_TASK, encoding="utf-8")
        (tmp_path / "drawing.svg").write_text(DRAWING, encoding="utf-8")
        return path

    return write
