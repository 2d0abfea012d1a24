"""The checks of a robot description: each finding, the refusal of hostile XML, and laws for any text."""

import json
import re
from pathlib import Path

import pinocchio as pin
import pytest
from lxml import etree

from pathcontrol.robot.urdf import Finding, check_urdf, parse_urdf

MOMENTS = 'ixx="0.02" ixy="0" ixz="0" iyy="0.02" iyz="0" izz="0.01"'
INERTIAL = f'<inertial><origin xyz="0 0 0.1"/><mass value="2"/><inertia {MOMENTS}/></inertial>'
AXIS = '<axis xyz="0 1 0"/>'
LIMIT = '<limit lower="-1" upper="1" effort="10" velocity="2"/>'
NO_MOMENTS = 'ixx="0" ixy="0" ixz="0" iyy="0" iyz="0" izz="0"'


def link(name, inside=INERTIAL):
    return f'<link name="{name}">{inside}</link>'


def joint(name, parent, child, kind="revolute", inside=AXIS + LIMIT):
    ends = f'<parent link="{parent}"/><child link="{child}"/>'
    return f'<joint name="{name}" type="{kind}">{ends}{inside}</joint>'


def robot(*parts, attributes='name="two"'):
    return f"<robot {attributes}>\n" + "\n".join(parts) + "\n</robot>\n"


BASE, UPPER, LOWER = link("base", ""), link("upper"), link("lower")
SHOULDER, ELBOW = joint("shoulder", "base", "upper"), joint("elbow", "upper", "lower")
ARM = robot(BASE, UPPER, LOWER, SHOULDER, ELBOW)


def elbow(inside=AXIS + LIMIT, kind="revolute"):
    """The arm with another elbow."""
    return robot(BASE, UPPER, LOWER, SHOULDER, joint("elbow", "upper", "lower", kind, inside))


def hand(inside):
    """The arm with another last link."""
    return robot(BASE, UPPER, link("lower", inside), SHOULDER, ELBOW)


def inertial(mass="2", moments=MOMENTS, origin=""):
    return f'<inertial>{origin}<mass value="{mass}"/><inertia {moments}/></inertial>'


def find(report, code):
    return [finding for finding in report.findings if finding.code == code]


def read_by_pinocchio(text):
    return pin.buildModelFromXML(etree.tostring(parse_urdf(text), encoding="unicode"))


def test_a_sound_arm_has_nothing_to_report():
    report = check_urdf(ARM)
    assert report.findings == ()
    assert report.ok
    assert (report.name, report.links) == ("two", ("base", "upper", "lower"))
    assert report.joints == ("shoulder", "elbow")


ERRORS = {
    "no name": (robot(*ARM.splitlines()[1:-1], attributes=""), "name-missing", "name"),
    "version": (ARM.replace("<robot", '<robot version="7.0"'), "version-unknown", "7.0"),
    "no links": ('<robot name="empty"/>', "no-links", "<link>"),
    "too many links": (robot(*(link(f"l{i}", "") for i in range(1001))), "too-many-links", "1001"),
    "no joint": (robot(BASE), "no-movable-joint", "0 joints"),
    "nothing moves": (
        robot(BASE, UPPER, joint("j", "base", "upper", "fixed")),
        "no-movable-joint",
        "1 joints",
    ),
    "unnamed link": (robot(BASE, UPPER, LOWER, SHOULDER, ELBOW, "<link/>"), "name-missing", "1 <link>"),
    "unnamed joint": (ARM.replace('name="elbow" ', ""), "name-missing", "1 <joint>"),
    "same links": (robot(BASE, UPPER, LOWER, UPPER, SHOULDER, ELBOW), "duplicate-link", "2 <link>"),
    "same joints": (ARM.replace('"elbow"', '"shoulder"'), "duplicate-joint", "2 <joint>"),
    "same materials": (robot(*['<material name="m"/>'] * 2, BASE), "duplicate-material", "2 <material>"),
    "parent": (ARM.replace('<parent link="upper"', '<parent link="uper"'), "parent-unknown", "'uper'"),
    "child": (ARM.replace('<child link="lower"', '<child link="lover"'), "child-unknown", "'lover'"),
    "no parent": (ARM.replace('<parent link="upper"/>', ""), "part-missing", "<parent>"),
    "no child": (ARM.replace('<child link="lower"/>', ""), "part-missing", "<child>"),
    "parent without link": (
        ARM.replace('<parent link="upper"/>', "<parent/>"),
        "part-missing",
        "link of <parent>",
    ),
    "no type": (ARM.replace(' type="revolute"', "", 1), "type-missing", "revolute"),
    "type": (elbow(kind="Revolute"), "type-unknown", "'Revolute'"),
    "roots": (robot(BASE, UPPER, LOWER, SHOULDER), "several-roots", "'lower'"),
    "two parents": (
        robot(BASE, UPPER, LOWER, SHOULDER, ELBOW, joint("j", "base", "lower")),
        "two-parents",
        "'j'",
    ),
    "loop": (robot(BASE, UPPER, LOWER, ELBOW, joint("j", "lower", "upper")), "loop", "'upper' -> 'lower'"),
    "self loop": (robot(BASE, UPPER, SHOULDER, joint("j", "base", "base")), "loop", "'base' -> 'base'"),
    "floating": (elbow(kind="floating"), "joint-floating", "fixed-base arms only"),
    "planar": (elbow(kind="planar"), "joint-planar", "fixed-base arms only"),
    "mimic": (elbow(AXIS + LIMIT + '<mimic joint="shoulder"/>'), "joint-mimic", "'shoulder'"),
    "mimic of nothing": (elbow(AXIS + LIMIT + "<mimic/>"), "part-missing", "joint of <mimic>"),
    "axis zero": (elbow('<axis xyz="0 0 0"/>' + LIMIT), "axis-zero", "'0 0 0'"),
    "axis nearly zero": (elbow('<axis xyz="0 1e-200 0"/>' + LIMIT), "axis-zero", "1e-200"),
    "axis nan": (elbow('<axis xyz="0 nan 0"/>' + LIMIT), "not-a-number", "'0 nan 0'"),
    "axis of two": (elbow('<axis xyz="0 1"/>' + LIMIT), "not-a-number", "'0 1'"),
    "axis without xyz": (elbow("<axis/>" + LIMIT), "part-missing", "xyz of <axis>"),
    "decimal comma": (elbow('<origin xyz="0 0,45 0"/>' + AXIS + LIMIT), "not-a-number", "'0 0,45 0'"),
    "rpy": (elbow('<origin rpy="0 0 pi"/>' + AXIS + LIMIT), "not-a-number", "'0 0 pi'"),
    "quaternion": (elbow('<origin quat_xyzw="0 0 0 1"/>' + LIMIT), "origin-quaternion", "'0 0 0 1'"),
    "no limit": (elbow(AXIS), "joint-no-limit", "revolute"),
    "no effort": (elbow('<limit lower="0" upper="1" velocity="1"/>'), "part-missing", "effort of <limit>"),
    "no velocity": (elbow('<limit lower="0" upper="1" effort="1"/>'), "part-missing", "velocity of <limit>"),
    "effort inf": (elbow('<limit effort="inf" velocity="1"/>'), "not-a-number", "'inf'"),
    "effort huge": (elbow('<limit effort="1e400" velocity="1"/>'), "not-a-number", "'1e400'"),
    "effort in words": (elbow('<limit effort="10 Nm" velocity="1"/>'), "not-a-number", "'10 Nm'"),
    "effort with space": (elbow('<limit effort="10 " velocity="1"/>'), "not-a-number", "'10 '"),
    "effort negative": (elbow('<limit lower="-1" effort="-10" velocity="1"/>'), "effort-negative", "-10"),
    "velocity negative": (elbow('<limit lower="-1" effort="10" velocity="-3"/>'), "velocity-negative", "-3"),
    "limits exchanged": (
        elbow('<limit lower="2" upper="1" effort="1" velocity="1"/>'),
        "limit-inverted",
        "2 is",
    ),
    "upper missing": (elbow('<limit lower="2" effort="1" velocity="1"/>'), "limit-inverted", "upper 0"),
    "damping negative": (elbow(AXIS + LIMIT + '<dynamics damping="-0.5"/>'), "damping-negative", "-0.5"),
    "friction negative": (elbow(AXIS + LIMIT + '<dynamics friction="-7"/>'), "friction-negative", "-7"),
    "damping not a number": (elbow(AXIS + LIMIT + '<dynamics damping="x"/>'), "not-a-number", "'x'"),
    "dynamics empty": (elbow(AXIS + LIMIT + "<dynamics/>"), "part-missing", "<dynamics>"),
    "mass negative": (hand(inertial(mass="-2")), "mass-negative", "-2 kg"),
    "mass nan": (hand(inertial(mass="nan")), "not-a-number", "'nan'"),
    "mass in grams": (hand(inertial(mass="2kg")), "not-a-number", "'2kg'"),
    "mass absurd": (hand(inertial(mass="1e200")), "number-absurd", "'1e200'"),
    "no mass": (hand(f"<inertial><inertia {MOMENTS}/></inertial>"), "part-missing", "<mass>"),
    "no inertia": (hand('<inertial><mass value="1"/></inertial>'), "part-missing", "<inertia>"),
    "no izz": (hand(inertial(moments=MOMENTS.replace("izz", "zz"))), "part-missing", "izz of <inertia>"),
    "inertia not a number": (hand(inertial(moments=MOMENTS.replace("0.01", "1/2"))), "not-a-number", "'1/2'"),
    "inertia negative": (
        hand(inertial(moments=MOMENTS.replace("0.01", "-0.01"))),
        "inertia-negative",
        "-0.01",
    ),
    "inertia indefinite": (
        hand(inertial(moments=MOMENTS.replace('iyz="0"', 'iyz="9"'))),
        "inertia-negative",
        "9.0",
    ),
    "inertial origin": (hand(inertial(origin='<origin xyz="0 0"/>')), "not-a-number", "'0 0'"),
    "no inertia at all": (hand(""), "mass-matrix-singular", "0 kg m^2"),
    "slider without mass": (hand("").replace("revolute", "prismatic"), "mass-matrix-singular", "0 kg"),
    "slider of tiny mass": (
        hand(inertial("1e-320")).replace("revolute", "prismatic"),
        "mass-matrix-singular",
        "e-321 kg",
    ),
    "point mass on axis": (hand(inertial(moments=NO_MOMENTS)), "mass-matrix-singular", "0 kg m^2"),
}


@pytest.mark.parametrize(("text", "code", "shown"), ERRORS.values(), ids=ERRORS.keys())
def test_what_makes_a_robot_unusable_is_an_error_that_shows_the_value(text, code, shown):
    report = check_urdf(text)
    assert not report.ok
    (finding, *_) = find(report, code)
    assert finding.level == "error"
    assert finding in report.errors
    assert shown in finding.message


WARNINGS = {
    "continuous without limit": (elbow(AXIS, "continuous"), "joint-no-limit", "infinite"),
    "effort 0": (elbow(AXIS + LIMIT.replace('"10"', '"0"')), "effort-zero", "effort is 0"),
    "velocity 0": (elbow(AXIS + LIMIT.replace('"2"', '"0"')), "velocity-zero", "velocity is 0"),
    "absurd": (elbow(AXIS + LIMIT.replace('"10"', '"1.797e308"')), "limit-absurd", "1.797e+308"),
    "no range": (elbow('<limit effort="1" velocity="1"/>'), "limit-no-range", "both 0"),
    "a point": (elbow('<limit lower="1" upper="1" effort="1" velocity="1"/>'), "limit-no-range", "both 1"),
    "slider without range": (
        elbow('<limit effort="1" velocity="1"/>', "prismatic"),
        "limit-no-range",
        "both 0",
    ),
    "long axis": (elbow('<axis xyz="0 3 4"/>' + LIMIT), "axis-not-unit", "length 5"),
    "triangle": (hand(inertial(moments=MOMENTS.replace("0.01", "0.05"))), "inertia-triangle", "0.05"),
    "mass 0": (hand(inertial(mass="0")), "mass-zero", "0 kg"),
    "two limits": (elbow(AXIS + LIMIT * 2), "repeated-element", "2 times"),
    "http mesh": (
        hand(INERTIAL + '<visual><geometry><mesh filename="http://h/m.stl"/></geometry></visual>'),
        "mesh-remote",
        "http://h/m.stl",
    ),
    "no shape": (hand(INERTIAL + "<visual><geometry/></visual>"), "shape-unreadable", "nothing"),
    "no radius": (
        hand(INERTIAL + "<visual><geometry><sphere/></geometry></visual>"),
        "shape-unreadable",
        "radius",
    ),
    "bad size": (
        hand(INERTIAL + '<collision><geometry><box size="1 1"/></geometry></collision>'),
        "shape-unreadable",
        "'1 1'",
    ),
}


@pytest.mark.parametrize(("text", "code", "shown"), WARNINGS.values(), ids=WARNINGS.keys())
def test_what_was_probably_not_meant_is_a_warning_and_pinocchio_reads_the_robot(text, code, shown):
    report = check_urdf(text)
    (finding,) = find(report, code)
    assert finding.level == "warning"
    assert finding in report.warnings
    assert shown in finding.message
    assert report.ok
    read_by_pinocchio(text)


def test_continuous_joints_and_friction_are_notes():
    text = elbow(AXIS + LIMIT + '<dynamics damping="2.288" friction="7.17"/>', "continuous")
    report = check_urdf(text)
    assert {finding.code: finding.level for finding in report.findings} == {
        "joint-continuous": "note",
        "friction-present": "note",
    }
    (friction,) = find(report, "friction-present")
    assert "2.288" in friction.message
    assert "7.17" in friction.message


def test_extensions_are_silent():
    extensions = (
        '<gazebo reference="upper"><mu1>${mu}</mu1><sdf xmlns="urn:sdf"><link/></sdf></gazebo>',
        '<transmission name="t"><joint name="elbow"/></transmission>',
        '<ros2_control name="c"><joint name="elbow"/></ros2_control>',
        "<mujoco><compiler/></mujoco>",
        '<pathcontrol><joint name="elbow"/></pathcontrol>',
    )
    assert check_urdf(robot(BASE, UPPER, LOWER, SHOULDER, ELBOW, *extensions)).findings == ()


def test_the_zero_axis_that_exporters_give_fixed_joints_is_silent():
    tool = joint("flange", "lower", "tool", "fixed", '<axis xyz="0 0 0"/>')
    assert check_urdf(robot(BASE, UPPER, LOWER, link("tool", ""), SHOULDER, ELBOW, tool)).findings == ()


def test_a_locked_mimic_joint_is_taken_as_fixed():
    mimic = '<limit effort="0" velocity="0"/><mimic joint="shoulder" multiplier="-1"/>'
    text = elbow(AXIS + mimic)
    assert [finding.code for finding in check_urdf(text).errors] == ["joint-mimic"]
    report = check_urdf(text, allow_mimic=["elbow"])
    assert report.findings == ()
    assert report.joints == ("shoulder", "elbow")


def test_locking_a_joint_without_inertia_makes_the_robot_usable():
    assert check_urdf(hand(""), allow_mimic=["elbow"]).ok
    (finding,) = check_urdf(ARM, allow_mimic=["shoulder", "elbow"]).errors
    assert finding.code == "no-movable-joint"


def test_a_wrong_inertia_only_matters_where_it_moves():
    bad = link("base", inertial(moments=MOMENTS.replace("0.01", "-0.01")))
    report = check_urdf(robot(bad, UPPER, LOWER, SHOULDER, ELBOW))
    assert [(finding.level, finding.code) for finding in report.findings] == [("warning", "inertia-negative")]


def test_an_inertial_is_missed_on_shapes_and_bodies_but_not_on_frames():
    shape = '<visual><geometry><sphere radius="1"/></geometry></visual>'
    parts = (BASE, UPPER, LOWER, SHOULDER, ELBOW, joint("flange", "lower", "tool", "fixed", ""))
    assert check_urdf(robot(*parts, link("tool", ""))).findings == ()
    (finding,) = check_urdf(robot(*parts, link("tool", shape))).findings
    assert (finding.code, finding.where) == ("inertial-missing", "link 'tool'")
    (finding,) = check_urdf(robot(BASE, link("upper", ""), LOWER, SHOULDER, ELBOW)).findings
    assert (finding.code, finding.where) == ("inertial-missing", "link 'upper'")


@pytest.mark.parametrize("scheme", ["", "package://", "file://"])
def test_meshes_are_looked_for_in_the_folders_given(tmp_path, scheme):
    (tmp_path / "pack" / "urdf").mkdir(parents=True)
    (tmp_path / "pack" / "upper.stl").write_text("solid")
    name = f"file://{tmp_path}/pack/upper.stl" if scheme == "file://" else f"{scheme}pack/upper.stl"
    shape = f'<visual><geometry><mesh filename="{name}"/></geometry></visual>'
    assert check_urdf(hand(INERTIAL + shape), package_dirs=[tmp_path]).findings == ()
    if scheme == "package://":
        assert check_urdf(hand(INERTIAL + shape), base_dir=tmp_path / "pack" / "urdf").findings == ()
    (tmp_path / "pack" / "upper.stl").unlink()
    (finding,) = check_urdf(hand(INERTIAL + shape), base_dir=tmp_path).findings
    assert (finding.level, finding.code) == ("warning", "mesh-missing")
    assert "upper.stl" in finding.message


def test_a_text_that_was_checked_before_is_checked_anew_where_its_meshes_or_locks_are_others(tmp_path):
    arm = hand(INERTIAL + '<visual><geometry><mesh filename="lower.stl"/></geometry></visual>')
    for _ in range(2):
        assert [finding.code for finding in check_urdf(arm, base_dir=tmp_path).findings] == ["mesh-missing"]
    (tmp_path / "lower.stl").write_text("solid")
    assert check_urdf(arm, base_dir=tmp_path).findings == ()
    mimicking = elbow(AXIS + LIMIT + '<mimic joint="shoulder"/>')
    assert find(check_urdf(mimicking), "joint-mimic")
    assert not find(check_urdf(mimicking, allow_mimic=["shoulder"]), "joint-mimic")
    assert find(check_urdf(mimicking), "joint-mimic")


def test_a_relative_mesh_is_not_missed_without_a_folder():
    shape = '<visual><geometry><mesh filename="meshes/upper.stl"/></geometry></visual>'
    assert check_urdf(hand(INERTIAL + shape)).findings == ()


def test_the_report_is_plain_json():
    report = check_urdf(elbow(AXIS))
    data = json.loads(json.dumps(report.as_dict()))
    assert data["ok"] is False
    assert data["joints"] == ["shoulder", "elbow"]
    assert Finding(**data["findings"][0]) == report.findings[0]
    assert str(report.findings[0]).startswith("error: joint 'elbow': ")


def test_findings_come_errors_first_and_stay_on_one_line():
    text = elbow('<axis xyz="0 2 0"/><limit effort="0" velocity="-1" upper="-1"/><dynamics damping="1"/>')
    report = check_urdf(text)
    order = [("error", "warning", "note").index(finding.level) for finding in report.findings]
    assert order == sorted(order)
    assert set(order) == {0, 1, 2}
    assert all("\n" not in str(finding) for finding in report.findings)


# --- <pathcontrol> ------------------------------------------------------------------------------------------------


def extended(extension: str) -> str:
    return ARM.replace("</robot>", f"<pathcontrol>{extension}</pathcontrol></robot>")


@pytest.mark.parametrize(
    ("extension", "code", "value"),
    [
        ("<joint name='nose'><coulomb positive='1' negative='1'/></joint>", "extension-joint", "nose"),
        ("<motor/>", "extension-joint", "motor"),
        ("<joint name='elbow'><grease/></joint>", "extension-element", "grease"),
        ("<joint name='elbow'><coulomb positive='1'/></joint>", "extension-number", "negative"),
        ("<joint name='elbow'><coulomb positive='-1' negative='1'/></joint>", "extension-number", "-1"),
        ("<joint name='elbow'><coulomb positive='much' negative='1'/></joint>", "extension-number", "much"),
        ("<joint name='elbow'><encoder counts_per_revolution='0'/></joint>", "extension-number", "above 0"),
        ("<joint name='elbow'><encoder counts_per_revolution='nan'/></joint>", "extension-number", "nan"),
    ],
)
def test_the_extension_is_checked(extension, code, value):
    findings = check_urdf(extended(extension)).errors
    assert [finding.code for finding in findings] == [code]
    assert value in findings[0].message


def test_the_extension_of_the_bundled_arm_is_sound():
    text = (Path(__file__).parents[2] / "urdf" / "cicese_2dof.urdf").read_text()
    assert check_urdf(text).ok
    one_missing = re.sub(r'<encoder counts_per_revolution="655360"/>', "", text)
    assert [f.code for f in check_urdf(one_missing).warnings] == ["extension-encoders"]
