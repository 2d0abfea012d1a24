"""Accuracy and power balance of an arm whose joints slide are in metres."""

import pytest

import pathcontrol as pc

LINK = """<link name="{0}"><inertial><mass value="2"/><inertia ixx=".1" iyy=".1" izz=".1" ixy="0" ixz="0" iyz="0"/>
</inertial></link>"""
JOINT = """<joint name="{0}" type="prismatic"><parent link="{1}"/><child link="{2}"/><axis xyz="{3}"/>
<limit lower="-3" upper="3" effort="100" velocity="10"/></joint>"""


@pytest.mark.parametrize(
    ("make", "unit", "rate_unit"),
    [
        (lambda arm, path: pc.Projection(arm, path, 100.0, 20.0), "m^2/s^2", "m^2/s^3"),
        (lambda arm, path: pc.ExtendedMotionPlan(arm, path, 100.0, 20.0, k=5.0), "m^2", "m^2/s"),
    ],
    ids=["projection", "plan"],
)
def test_a_gantry_is_measured_in_metres(tmp_path, make, unit, rate_unit):
    joints = JOINT.format("x", "base", "one", "1 0 0") + JOINT.format("y", "one", "two", "0 1 0")
    text = "".join(map(LINK.format, ("base", "one", "two")))
    (tmp_path / "gantry.urdf").write_text(f'<robot name="gantry">{text}{joints}</robot>')
    arm, circle = pc.load_robot(tmp_path / "gantry.urdf"), pc.Circle(0.2, 0.8)
    run = pc.simulate(make(arm, circle), [0.2, 0.0], duration=4.0, progress=False)
    assert pc.accuracy(run).unit == pc.ballbar(run).unit == "m"
    balance = pc.power_balance(run)
    assert (balance.unit, balance.rate_unit) == (unit, rate_unit)


@pytest.mark.parametrize(
    ("law", "unit", "rate_unit"),
    [
        (pc.Projection, "rad^2/s^2 or m^2/s^2", "rad^2/s^3 or m^2/s^3"),
        (pc.ComputedTorque, "rad^2 or m^2", "rad^2/s or m^2/s"),
        (pc.ManeuverRegulation, "rad^2 s or m^2 s", "rad^2 or m^2"),
        (pc.PDPlus, "J", "W"),
    ],
)
def test_v_of_an_arm_that_turns_and_slides_has_both_units(law, unit, rate_unit):
    joints = JOINT.format("x", "base", "one", "1 0 0") + JOINT.format("turn", "one", "two", "0 0 1").replace(
        "prismatic", "revolute"
    )
    text = "".join(map(LINK.format, ("base", "one", "two")))
    arm = pc.load_robot(f'<robot name="crane">{text}{joints}</robot>')
    run = pc.simulate(law(arm, pc.Circle(0.2, 0.8), 100.0, 20.0), [0.2, 0.0], duration=0.1, progress=False)
    balance = pc.power_balance(run)
    assert (balance.unit, balance.rate_unit) == (unit, rate_unit)
