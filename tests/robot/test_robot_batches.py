"""A batch of states is a loop over them, to the last bit."""

from functools import partial

import numpy as np
import pytest
from numpy.testing import assert_array_equal
from test_robot_model import every_robot, frame_of, load, states

#: method: how many joint arrays it takes
BATCHED = {
    "inverse_dynamics": 3,
    "forward_dynamics": 3,
    "nonlinear_effects": 2,
    "gravity": 1,
    "mass_matrix": 1,
    "coriolis": 3,
    "coriolis_matrix": 2,
    "kinetic_energy": 2,
    "potential_energy": 1,
    "frame_pose": 1,
    "frame_jacobian": 1,
}


every_method = pytest.mark.parametrize("method", BATCHED)


def call(name, method):
    """A bound method; those about frames get the frame."""
    function = getattr(load(name), method)
    return partial(function, frame=frame_of(name)) if method.startswith("frame") else function


def shape_of_one(robot, method):
    """Shape of the result for a single configuration."""
    n = robot.n
    special = {
        "mass_matrix": (n, n),
        "coriolis_matrix": (n, n),
        "frame_pose": (4, 4),
        "frame_jacobian": (6, n),
        "kinetic_energy": (),
        "potential_energy": (),
    }
    return special.get(method, (n,))


@every_robot
@every_method
def test_a_batch_is_a_loop(name, method):
    robot, function = load(name), call(name, method)
    one = shape_of_one(robot, method)
    arguments = states(robot, 2, (2, 3), BATCHED[method])
    whole = np.asarray(function(*arguments))
    assert whole.shape == (2, 3, *one)
    for i in range(2):
        assert_array_equal(function(*(a[i] for a in arguments)), whole[i])
        for j in range(3):
            single = function(*(a[i, j] for a in arguments))
            assert np.shape(single) == one
            assert_array_equal(single, whole[i, j])


@every_robot
@every_method
def test_an_empty_batch_is_empty(name, method):
    robot = load(name)
    for batch in ((0,), (2, 0)):
        arguments = [np.zeros((*batch, robot.n))] * BATCHED[method]
        assert call(name, method)(*arguments).shape == (*batch, *shape_of_one(robot, method))


@pytest.mark.parametrize("name", ["cicese_2dof", "panda"])
@pytest.mark.parametrize("method", [m for m, count in BATCHED.items() if count > 1])
def test_batch_axes_broadcast(name, method):
    robot, function = load(name), call(name, method)
    arguments = states(robot, 3, (2, 3), BATCHED[method])
    for kept in range(len(arguments)):
        mixed = [a if i == kept else a[0, 0] for i, a in enumerate(arguments)]
        full = [np.array(np.broadcast_to(a, (2, 3, robot.n))) for a in mixed]
        assert_array_equal(function(*mixed), function(*full))
    outer = [a[:, :1] if i == 0 else a[:1] for i, a in enumerate(arguments)]
    full = [np.array(np.broadcast_to(a, (2, 3, robot.n))) for a in outer]
    assert_array_equal(function(*outer), function(*full))


@pytest.mark.parametrize("name", ["cicese_2dof", "panda"])
@every_method
@pytest.mark.parametrize(
    "scatter",
    [
        np.asfortranarray,
        lambda a: np.repeat(a, 2, axis=0)[::2],
        lambda a: np.repeat(a, 2, axis=-1)[..., ::2],
        lambda a: a[::-1].copy()[::-1],
        lambda a: a[..., ::-1].copy()[..., ::-1],
        lambda a: np.ascontiguousarray(a.T).T,
        lambda a: a.tolist(),
    ],
    ids=["fortran", "every second row", "every second column", "reversed", "mirrored", "transposed", "list"],
)
def test_memory_layout_does_not_matter(name, method, scatter):
    function, arguments = call(name, method), states(load(name), 4, (5,), BATCHED[method])
    assert_array_equal(function(*map(scatter, arguments)), function(*arguments))


@pytest.mark.parametrize("method", [m for m in BATCHED if m != "frame_pose"])
def test_arguments_are_left_alone(method):
    arguments = states(load("ur5"), 5, (3,), BATCHED[method])
    before = [a.copy() for a in arguments]
    call("ur5", method)(*arguments)
    for a, b in zip(arguments, before, strict=True):
        assert_array_equal(a, b)


@pytest.mark.parametrize("name", ["cicese_2dof", "panda"])
@pytest.mark.parametrize("size", [1, 2, 3, 257])
def test_threads_do_not_change_a_bit(name, size):
    robot = load(name)
    two = robot.with_threads(2)
    arguments = states(robot, 6, (size,), 3)
    for method, count in BATCHED.items():
        if not method.startswith("frame"):
            one_thread = getattr(robot, method)(*arguments[:count])
            assert_array_equal(getattr(two, method)(*arguments[:count]), one_thread)
