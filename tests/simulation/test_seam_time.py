"""The time of disturbances and the noise go on across the seams of a sequence, in both engines alike."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose

import pathcontrol as pc

ARM = pc.load_robot("cicese_2dof").with_friction(None)
PATHS = [pc.Line([0.1 * i, 0.0], [0.1 * (i + 1), 0.0], 1.0) for i in range(3)]
LAWS = [pc.ComputedTorque(ARM, path, 400.0, 40.0) for path in PATHS]


def simulated(engine, disturbance=None, loop=None):
    return pc.simulate_sequence(
        LAWS, [0.0, 0.0], duration=0.9, disturbance=disturbance, loop=loop, engine=engine, progress=False
    )


@pytest.mark.parametrize("kind", ["push", "drop", "dropout", "friction", "wave"])
def test_a_disturbance_in_a_later_path_comes_when_it_says(kind):
    begin = float(simulated("compiled").data["path_finish_time"][1]) + 0.1
    what = {
        "push": pc.Push([20.0, 4.0], begin, 0.05),
        "drop": pc.TorqueLimitDrop(0.01, begin, 0.05),
        "dropout": pc.Dropout(begin, 0.05, fallback="zero"),
        "friction": pc.FrictionChange(coulomb=[9.0, 2.0], start=begin, duration=0.05),
        "wave": pc.Harmonic([2.0, 0.5], 7.0),
    }[kind]
    loop = pc.SampledLoop(torque_limits=True)
    one, other = (simulated(engine, what, loop) for engine in ("compiled", "pinocchio"))
    assert_allclose(one.array("q"), other.array("q"), rtol=0, atol=1e-10)
    calm = simulated("compiled", loop=loop)
    if kind != "wave":
        both = min(len(one.time), len(calm.time))
        apart = np.abs(one.array("q")[0, :both] - calm.array("q")[0, :both]).max(-1)
        first = np.flatnonzero(apart > 0)[0]
        assert one.time[first] == pytest.approx(begin, abs=2.6e-3)


def test_noise_is_that_of_the_reference_after_a_seam():
    loop = pc.SampledLoop(noise=pc.SensorNoise(position=1e-4, seed=3))
    one, other = (simulated(engine, loop=loop) for engine in ("compiled", "pinocchio"))
    assert_allclose(one.array("q_measured"), other.array("q_measured"), rtol=0, atol=1e-10)
