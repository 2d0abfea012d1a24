"""Friction laws of one's own: what is overridden counts, or the class is refused."""

from dataclasses import dataclass

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from pathcontrol.control.projection import Projection
from pathcontrol.errors import InputError
from pathcontrol.robot.friction import Coulomb, FrictionLaw, Stribeck, Viscous
from pathcontrol.robot.loading import load_robot
from pathcontrol.simulation.arm.plant import Plant
from pathcontrol.simulation.loops import ContinuousTime, SampledLoop
from pathcontrol.simulation.simulate import simulate
from pathcontrol.tasks.curves import Circle


@dataclass(frozen=True, eq=False)
class Falling(FrictionLaw):
    """Stribeck friction that does not say that it varies, with fields of any kind."""

    coulomb: object
    static: object
    velocity: float = 0.1

    @property
    def n(self):
        return len(self.coulomb)

    def levels(self, qd):
        low, high = np.asarray(self.coulomb), np.asarray(self.static)
        level = low + (high - low) * np.exp(-((qd / self.velocity) ** 2))
        return level, level


def test_a_law_that_overrides_torque_only_is_refused_with_what_to_override():
    with pytest.raises(InputError, match=r"Mine overrides torque\(\).*override levels\(qd\)"):

        class Mine(FrictionLaw):
            n = 2

            def torque(self, qd):
                return 3.0 * qd


def test_levels_that_vary_are_noticed_though_the_law_does_not_say_so():
    arm = load_robot("cicese_2dof")
    own = Plant(arm.with_friction(Falling((1.0, 0.5), (2.0, 1.0))), 1e-3)
    known = Plant(arm.with_friction(Stribeck([1.0, 0.5], [2.0, 1.0], [0.1, 0.1])), 1e-3)
    state = same = (np.array([[0.5, 0.2]]), np.array([[0.3, -0.2]]))
    for _ in range(50):
        state, same = own.advance(*state, np.zeros((1, 2))), known.advance(*same, np.zeros((1, 2)))
    assert_array_equal(state, same)


def test_fields_may_be_tuples_lists_and_numbers():
    law = Falling((1.0, 0.5), [2.0, 1.0])
    assert law.describe() == {"law": "Falling", "coulomb": [1.0, 0.5], "static": [2.0, 1.0], "velocity": 0.1}
    assert_allclose(law.select([1]).levels(np.zeros(1))[0], [1.0])


def two_joints(**methods):
    """An instance of a law with such methods."""
    return type("Mine", (FrictionLaw,), {"n": 2, **methods})()


B, F = np.array([2.0, 0.5]), np.array([1.0, 3.0])


@pytest.mark.parametrize(
    ("methods", "words"),
    [
        # the torque of a law whose viscous part was forgotten
        (
            {"levels": lambda self, qd: (F, F), "torque": lambda self, qd: B * qd + F * np.sign(qd)},
            ["Mine.torque gives -5 N m at -2 rad/s for joint 0", "give -1 N m"],
        ),
        # levels that were forgotten
        (
            {"viscous": B, "torque": lambda self, qd: B * qd + F * np.sign(qd)},
            ["Mine.torque gives -5 N m at -2 rad/s for joint 0", "give -4 N m"],
        ),
        # a sign
        (
            {"viscous": B, "torque": lambda self, qd: -B * qd},
            ["Mine.torque gives 4 N m at -2 rad/s for joint 0", "give -4 N m"],
        ),
        # continuous time would have another friction than the sampled loop
        (
            {"viscous": B, "levels": lambda self, qd: (F, F), "smoothed": lambda self, qd, width: B * qd},
            ["Mine.smoothed gives -4 N m", "give -5 N m"],
        ),
        ({"levels": lambda self, qd: (F, -F)}, ["Mine.levels gives F⁻ = [-1.0, -3.0] N m", "not negative"]),
        ({"levels": lambda self, qd: (F * np.nan, F)}, ["Mine.levels gives F⁺ = [nan, nan] N m"]),
    ],
)
def test_methods_that_contradict_one_another_are_refused_with_both_values(methods, words):
    law = two_joints(**methods)
    arm = load_robot("cicese_2dof")
    for given in (law, law + Stribeck([1.0, 0.5], [2.0, 1.0], [0.1, 0.1])):
        with pytest.raises(InputError) as error:
            arm.with_friction(given)
        assert all(word in str(error.value) for word in words), str(error.value)


def test_methods_that_agree_may_all_be_overridden():
    def smoothed(self, qd, width):
        return B * qd + F * np.arctan(qd / width) * 2 / np.pi

    law = two_joints(
        viscous=B,
        levels=lambda self, qd: (F, F),
        torque=lambda self, qd: B * qd + F * np.sign(qd),
        smoothed=smoothed,
    )
    assert load_robot("cicese_2dof").with_friction(law).friction is law


@pytest.mark.parametrize("form", [tuple, list, np.array, float])
@pytest.mark.parametrize("loop", [SampledLoop(), ContinuousTime(output_period=2.5e-3)], ids=["sampled", "continuous"])
def test_methods_may_return_numbers_tuples_and_lists(form, loop):
    """A law of the same values in another form moves the arm as the library's own does, in the plant and the law."""
    b, f = ([2.0, 2.0], [1.5, 1.5]) if form is float else ([2.0, 0.5], [1.0, 3.0])
    give = (lambda values: values[0]) if form is float else form
    mine = two_joints(viscous=give(b), levels=lambda self, qd: (give(f), give(f)))
    runs = []
    for law in (Viscous(b) + Coulomb(f, f), mine, mine + Viscous([0.0, 0.0])):
        robot = load_robot("cicese_2dof").with_friction(law)
        assert_allclose(robot.friction.torque(np.array([[1.0, -2.0]])), [[b[0] + f[0], -2 * b[1] - f[1]]])
        controller = Projection(robot, Circle(0.5, 2.0), 400.0, [40.0, 40.0], friction="viscous")
        runs.append(simulate(controller, [0.45, 0.02], duration=0.04, loop=loop, progress=False))
    for run in runs[1:]:
        assert_allclose(run.array("q"), runs[0].array("q"), atol=1e-6)
