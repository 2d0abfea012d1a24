"""What disturbs all rollouts alike acts on each of them, in both engines and for every kind of law."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

import pathcontrol as pc
from pathcontrol.engine.structs import address_of

START = np.array([[1.0, 0.0], [0.9, 0.2], [1.1, -0.1]])
DISTURBANCES = {
    "jam": lambda: pc.JammedJoint(1, 0.05, 0.05),
    "jam of the first joint": lambda: pc.JammedJoint(0, 0.05, 0.05),
    "push": lambda: pc.Push([5.0, 1.0], 0.05, 0.05),
    "pick-up": lambda: pc.PickUp(2.0, "tool", 0.05),
    "weak motors": lambda: pc.TorqueLimitDrop(0.02, 0.05, 0.05),
    "friction": lambda: pc.FrictionChange(3.0, 0.05, 0.05),
    "lost ticks": lambda: pc.Dropout(0.05, 0.05, "ticks"),
    "lost measurements": lambda: pc.Dropout(0.05, 0.05, "measurements"),
    "wall": lambda: pc.Wall("tool", [0.7815, 0.0, 0.0], [-1.0, 0.0, 0.0], rigid=True),
}


def make_law(arm, kind):
    law = pc.Projection(arm, pc.Circle(1.0, 2.0), 800.0, [45.0, 100.0])
    return pc.SpeedOverride(law) if kind == "in Python" else law


def run(law, q, disturbance, engine):
    loop = pc.SampledLoop(torque_limits=True)
    return pc.simulate(law, q, duration=0.15, loop=loop, disturbance=disturbance, engine=engine, progress=False)


@pytest.mark.parametrize("kind", ["compiled", "in Python"])
@pytest.mark.parametrize("name", DISTURBANCES)
def test_each_rollout_is_disturbed_as_it_is_alone(arm, name, kind):
    law, disturbance = make_law(arm, kind), DISTURBANCES[name]()
    together = run(law, START, disturbance, "compiled")
    for i, q in enumerate(START):
        assert_array_equal(together.array("q")[i], run(law, q, disturbance, "compiled").array("q")[0])
    reference = run(law, START, disturbance, "pinocchio")
    assert_allclose(together.array("q"), reference.array("q"), rtol=0, atol=1e-9)
    undisturbed = run(law, START, None, "compiled")
    assert (np.abs(together.array("q") - undisturbed.array("q")).max((1, 2)) > 1e-6).all()


@pytest.mark.parametrize("joint", [0, 1])
def test_a_jam_holds_the_joint_of_every_rollout_and_no_other(arm, joint):
    jammed = run(make_law(arm, "in Python"), START, pc.JammedJoint(joint, 0.05, 0.05), "compiled")
    q = jammed.array("q")[:, (jammed.time > 0.05 + 1e-9) & (jammed.time < 0.1)]
    assert (np.ptp(q[..., joint], axis=1) == 0).all()
    assert (np.ptp(q[..., 1 - joint], axis=1) > 1e-3).all()


def test_an_array_in_another_order_never_reaches_the_engine():
    rows = np.broadcast_to(np.array([[0.0, 1.0]]), (3, 2))
    with pytest.raises(pc.EngineError, match="does not lie row after row"):
        address_of(np.array(rows))  # NumPy keeps the order of what was repeated
    assert address_of(np.ascontiguousarray(rows))
