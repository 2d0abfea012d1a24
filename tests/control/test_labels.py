"""Arrays of joints that are labelled go by their labels, whatever their order, or are refused."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
import xarray as xr

import pathcontrol as pc
from pathcontrol.errors import InputError

Q, QD = np.array([0.3, -0.8]), np.array([1.5, -0.4])


def labelled(kind: str, joints: tuple[str, ...], values: np.ndarray) -> object:
    """Values in the order of the joints, as something that is labelled in the reverse order."""
    names, values = list(joints)[::-1], values[..., ::-1]
    if kind == "Series":
        return pd.Series(values, index=names)
    if kind == "dict":
        return dict(zip(names, values.tolist(), strict=True))
    if kind == "DataFrame":
        return pd.DataFrame(np.atleast_2d(values), columns=names)
    if kind == "DataArray":
        return xr.DataArray(values, dims=["joint"], coords={"joint": names})
    return xr.DataArray(np.atleast_2d(values).T, dims=["joint", "time"], coords={"joint": names, "time": [0.0]})


KINDS = ("Series", "DataFrame", "DataArray", "DataArray first", "dict")


@pytest.mark.parametrize("kind", KINDS)
def test_dynamics_and_kinematics_go_by_name(arm, kind):
    q, qd = (labelled(kind, arm.joint_names, values) for values in (Q, QD))
    pairs = [
        (arm.inverse_dynamics(q, qd, qd), arm.inverse_dynamics(Q, QD, QD)),
        (arm.inverse_dynamics(q, qd, qd, velocity=q), arm.inverse_dynamics(Q, QD, QD, velocity=Q)),
        (arm.forward_dynamics(q, qd, q), arm.forward_dynamics(Q, QD, Q)),
        (arm.gravity(q), arm.gravity(Q)),
        (arm.nonlinear_effects(q, qd), arm.nonlinear_effects(Q, QD)),
        (arm.mass_matrix(q), arm.mass_matrix(Q)),
        (arm.coriolis(q, qd, q), arm.coriolis(Q, QD, Q)),
        (arm.coriolis_matrix(q, qd), arm.coriolis_matrix(Q, QD)),
        (arm.kinetic_energy(q, qd), arm.kinetic_energy(Q, QD)),
        (arm.potential_energy(q), arm.potential_energy(Q)),
        (arm.frame_pose(q, "tool"), arm.frame_pose(Q, "tool")),
        (arm.frame_jacobian(q, "tool"), arm.frame_jacobian(Q, "tool")),
        (arm.frame_kinematics(q, "tool")[1], arm.frame_kinematics(Q, "tool")[1]),
        (arm.frame_motion(q, qd, qd, "tool")[1], arm.frame_motion(Q, QD, QD, "tool")[1]),
    ]
    for by_name, by_order in pairs:
        np.testing.assert_array_equal(np.squeeze(by_name), by_order)
        assert not np.array_equal(by_order, by_order * 0)


@pytest.mark.parametrize("kind", ["Series", "DataArray", "dict"])
def test_gains_starts_and_limits_go_by_name(arm, circle, kind):
    K_p, K_v = np.array([800.0, 400.0]), np.array([45.0, 100.0])

    def by(values: np.ndarray) -> object:
        return labelled(kind, arm.joint_names, values)

    plain, named = (pc.ExtendedMotionPlan(arm, circle, *gains, 20.0) for gains in ((K_p, K_v), (by(K_p), by(K_v))))
    np.testing.assert_array_equal(named.K_p, plain.K_p)
    np.testing.assert_array_equal(named.K_v, plain.K_v)
    starts = [pc.simulate(law, q=q, qd=qd, duration=0.05) for law, q, qd in ((plain, Q, QD), (named, by(Q), by(QD)))]
    np.testing.assert_array_equal(starts[0].array("q"), starts[1].array("q"))
    np.testing.assert_array_equal(arm.with_armature(by(Q**2)).armature, arm.with_armature(Q**2).armature)
    tool = pc.ToolCurve.line([0.4, -0.05, 0.7], [0.4, -0.05, 0.8])
    one, other = (pc.CartesianPath(arm, "tool", tool, speed=0.1, start=q) for q in (Q, by(Q)))
    np.testing.assert_array_equal(one.q_d(0.02), other.q_d(0.02))


@pytest.mark.parametrize("kind", KINDS)
def test_labels_of_other_joints_are_refused(arm, kind):
    with pytest.raises(InputError, match=r"q is labelled b, a, expected joint_1, joint_2"):
        arm.gravity(labelled(kind, ("a", "b"), Q))


def test_labels_that_are_no_names_say_nothing(arm):
    np.testing.assert_array_equal(arm.gravity(pd.Series(Q)), arm.gravity(Q))
    np.testing.assert_array_equal(arm.gravity(pd.DataFrame([Q, QD])), arm.gravity([Q, QD]))
    np.testing.assert_array_equal(arm.gravity(xr.DataArray([Q, QD], dims=["time", "joint"])), arm.gravity([Q, QD]))
    with pytest.raises(InputError, match="a label twice"):
        arm.gravity(pd.Series(Q, index=["joint_1", "joint_1"]))


@pytest.mark.parametrize("kind", ["Series", "DataArray", "DataFrame"])
def test_where_no_joints_are_known_labels_are_refused(arm, kind):
    named = labelled(kind, arm.joint_names, np.array([1.0, 2.0]))
    for make in (
        lambda: pc.Line(named, [0.0, 0.0], 1.0),
        lambda: pc.WaypointPath(named if kind == "DataFrame" else [2 * named, named], speed=1.0),
        lambda: pc.Viscous(named),
        lambda: pc.Coulomb(named),
        lambda: pc.Push(named, start=0.0, duration=1.0),
        lambda: pc.Circle(1.0, 1.0, center=named),
    ):
        with pytest.raises(InputError, match=r"is labelled joint_2, joint_1"):
            make()


def test_the_positions_of_a_run_are_a_run_of_positions(arm, circle):
    """What a run says by joint may be given back as it is."""
    run = pc.simulate(pc.ExtendedMotionPlan(arm, circle, 800.0, 45.0, 20.0), q=Q, duration=0.05)
    np.testing.assert_array_equal(arm.gravity(run.data["q"]), arm.gravity(run.data["q"].to_numpy()))
    np.testing.assert_array_equal(arm.gravity(run.data["q"].isel(joint=[1, 0])), arm.gravity(run.data["q"].to_numpy()))
