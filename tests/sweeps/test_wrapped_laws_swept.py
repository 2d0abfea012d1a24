"""Sweeps and tunings of wrapped laws: a sample is what it is alone, and an operator's hold is no failure."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy import stats

import pathcontrol as pc

pytest.importorskip("pyarrow")

ROBOT = pc.load_robot("cicese_2dof")
CIRCLE = pc.Circle(1.0, 2.0)
START = CIRCLE.q_d(np.array(0.0))
LOOP = pc.SampledLoop(torque_limits=True)
SPACE = {"K_p": stats.loguniform(400.0, 1600.0), "k": stats.uniform(5.0, 40.0)}

Parameters = Mapping[str, np.ndarray]
Wrap = Callable[[pc.Controller, Parameters], pc.Controller]
WRAPPERS: dict[str, Wrap] = {
    "override": lambda law, p: pc.SpeedOverride(law, [[0.1, 0.5]]),
    "override of each": lambda law, p: pc.SpeedOverride(law, p["k"] / 45.0),
    "paced": lambda law, p: pc.Paced(law),
    "events": lambda law, p: pc.EventPlan(law),
    "thresholds of each": lambda law, p: pc.EventPlan(law, np.stack([p["K_p"] / 40.0, p["K_p"] / 200.0], axis=1)),
    "all": lambda law, p: pc.Paced(pc.SpeedOverride(pc.EventPlan(law), 0.8)),
}


def builder(wrap: Wrap, duration: float = 0.2) -> Callable[[Parameters, np.ndarray], dict[str, Any]]:
    def build(p: Parameters, samples: np.ndarray) -> dict[str, Any]:
        law = pc.ExtendedMotionPlan(ROBOT, CIRCLE, p["K_p"][:, None], [45.0, 100.0], p["k"], friction="full")
        q = np.tile(START, (len(samples), 1))
        return {"controller": wrap(law, p), "q": q, "duration": duration, "loop": LOOP}

    return build


@pytest.mark.parametrize("name", WRAPPERS)
def test_a_sample_of_a_wrapped_law_is_what_it_is_alone(name: str, tmp_path: Path) -> None:
    build, space = builder(WRAPPERS[name]), pc.Space.sobol(SPACE, samples=3)
    swept = pc.sweep(build, space, tmp_path / "swept", chunk=2, keep=pc.Keep(worst=1), progress=False)
    table, design = swept.table(), space.design()
    for i in range(3):
        alone = pc.simulate(**build({n: v[[i]] for n, v in design.items()}, np.array([i])), progress=False)
        expected = pc.metrics(alone)
        for measured in ("contour_error_peak", "tau_peak"):
            if measured in expected:
                assert float(table[measured][i]) == pytest.approx(expected[measured][0], rel=1e-9)
    assert swept.run(swept.kept[0]).rollouts == 1


@pytest.mark.parametrize("name", ["override", "paced", "events", "all"])
def test_gains_of_a_wrapped_law_are_tuned(name: str) -> None:
    pytest.importorskip("pymoo")
    tuned = pc.tune(builder(WRAPPERS[name]), SPACE, "contour_error_peak", population=6, generations=2, progress=False)
    assert (tuned.table()["status"] == "running").all()
    least = float(tuned.table()["contour_error_peak"].min())
    assert tuned.best().metrics["contour_error_peak"] == pytest.approx(least)


OVERRIDES = {
    "held": [[0.2, 0.0]],
    "held for a while": [[0.15, 0.0], [0.45, 1.0]],
    "slow": 0.2,
    "slow, each": [0.1, 0.3, 1.0],
    "back": [[0.25, -1.0]],
    "fast": 2.0,
}


@pytest.mark.parametrize("name", OVERRIDES)
def test_a_plan_that_goes_as_an_operator_asks_is_not_unfinished(name: str, tmp_path: Path) -> None:
    build = builder(lambda law, p: pc.SpeedOverride(law, OVERRIDES[name]), duration=0.6)
    space = pc.Space.given({"K_p": [800.0, 900.0, 1000.0], "k": [20.0] * 3})
    swept = pc.sweep(build, space, tmp_path / "swept", chunk=3, metrics=["progress"], progress=False)
    assert list(swept.table()["status"].values) == ["running"] * 3


@pytest.mark.filterwarnings("ignore:the arm did not move")
def test_an_arm_that_stands_still_though_nobody_holds_it_is_unfinished(tmp_path: Path) -> None:
    """Motors without torque: the plan waits for the arm, whatever an operator who asks for motion says."""

    def build(p: Parameters, samples: np.ndarray) -> dict[str, Any]:
        law = pc.ExtendedMotionPlan(ROBOT, CIRCLE, 800.0, [45.0, 100.0], 200.0)
        jam = pc.JammedJoint(0, 0.0, 5.0) + pc.JammedJoint(1, 0.0, 5.0)
        q = np.tile(START, (len(samples), 1))
        return {"controller": pc.SpeedOverride(law, p["u"]), "q": q, "duration": 1.0, "disturbance": jam}

    swept = pc.sweep(build, pc.Space.given({"u": [1.0, 0.8]}), tmp_path / "swept", progress=False)
    assert list(swept.table()["status"].values) == ["unfinished"] * 2
