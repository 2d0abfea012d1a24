"""XML of robots that other readers take: taken, told with its line, and the same robot as its clean twin."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pathcontrol import load_robot
from pathcontrol.errors import PathControlWarning, UrdfError
from pathcontrol.robot.urdf import check_urdf, parse_urdf

LINK = (
    '<link name="{}"><inertial><origin xyz="0 0 0.1"/><mass value="2"/>'
    '<inertia ixx="0.02" iyy="0.02" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial></link>'
)
JOINT = (
    '<joint name="{}" type="revolute"><parent link="{}"/><child link="{}"/><origin xyz="0 0 0.3"/>'
    '<axis xyz="0 1 0"/><limit lower="-1" upper="1" effort="20" velocity="2"/></joint>'
)
LINES = [
    '<robot name="two">',
    '<link name="base"/>',
    LINK.format("upper"),
    LINK.format("lower"),
    JOINT.format("shoulder", "base", "upper"),
    JOINT.format("elbow", "upper", "lower"),
    "</robot>",
]
CLEAN = "\n".join(LINES)


def at(line: int, what: str) -> str:
    """The clean arm with one more line, whose number counts from 1."""
    return "\n".join([*LINES[: line - 1], what, *LINES[line - 1 :]])


XACRO = '<robot name="two" xmlns:xacro="http://ros.org/xacro">'
TAKEN = {
    "XML version": ('<?xml version="0.0"?>\n' + CLEAN, "xml-declaration", "line 1"),
    "XML version, encoding": ("<?xml version='0.1' encoding='UTF-8' ?>\n" + CLEAN, "xml-declaration", "line 1"),
    "blank first": ('\n  <?xml version="1.0"?>\n' + CLEAN, "xml-declaration", "line 2"),
    "blank and mark first": ('\ufeff \n\n<?xml version="1.0"?>\n' + CLEAN, "xml-declaration", "line 3"),
    "comment first": ('<!-- made\nby -->\n<?xml version="1.0"?>\n' + CLEAN, "xml-declaration", "line 3"),
    "prefix": (at(4, '<gazebo><ignition:camera a="1"/></gazebo>'), "xml-prefix", "line 4"),
    "prefix of an attribute": (at(3, '<gazebo><sensor gz:a="1"/></gazebo>'), "xml-prefix", "line 3"),
    "hyphens": (at(5, "<!-- one -- two -->"), "xml-comment", "line 5"),
    "hyphens over lines": (at(2, "<!--\n----------\n-->"), "xml-comment", "line 2"),
    "hyphen at the end": (at(3, "<!-- three --->"), "xml-comment", "line 3"),
    "xacro": (at(2, '<xacro:property name="a" value="1"/>').replace('<robot name="two">', XACRO), "xml-xacro", "2"),
    "xacro arg": (at(2, '<xacro:arg name="a" default="${b}"/>').replace('<robot name="two">', XACRO), "xml-xacro", "2"),
    "xacro undeclared": (at(3, '<xacro:property name="a" value="1"/>'), "xml-xacro", "line 3"),
    "URDF version": (CLEAN.replace("<robot", '<robot version="0.0"'), "xml-version", "line 1"),
}


@pytest.mark.parametrize(("text", "code", "line"), TAKEN.values(), ids=TAKEN.keys())
def test_what_other_readers_take_is_taken_with_a_warning_that_names_the_line(text, code, line):
    report = check_urdf(text)
    assert report.ok
    (finding,) = [finding for finding in report.findings if finding.code == code]
    assert finding.level == "warning"
    assert line in finding.message
    with pytest.warns(PathControlWarning, match=line):
        robot = load_robot(text)
    q = np.array([0.3, -0.4])
    np.testing.assert_array_equal(robot.mass_matrix(q), load_robot(CLEAN).mass_matrix(q))


def test_many_faults_at_once_are_all_told():
    text = '\n<?xml version="0.0"?>\n' + "\n".join(
        [
            LINES[0],
            "<!-- -- -->",
            '<xacro:property name="p" value="1"/>',
            *LINES[1:-1],
            "<gazebo><a:b/></gazebo></robot>",
        ]
    )
    report = check_urdf(text)
    assert report.ok
    codes = [finding.code for finding in report.findings]
    assert codes.count("xml-declaration") == 2
    assert codes.count("xml-prefix") == 2
    assert {"xml-comment", "xml-xacro"} <= set(codes)


REFUSED = {
    "doctype behind a bad comment": '<!-- -- --><!DOCTYPE robot [<!ENTITY x SYSTEM "file:///etc/hostname">]><robot>&x;</robot>',
    "doctype behind a late declaration": '\n<?xml version="1.0"?><!DOCTYPE robot [<!ENTITY a "b">]><robot name="&a;"/>',
    "doctype made by mending": '<!<!-- -- -->DOCTYPE robot [<!ENTITY a "b">]><robot name="&a;"/>',
    "entity": at(2, "&lol;"),
    "entity beside a bad comment": at(2, "<!-- -- -->&lol;"),
    "macro": at(2, '<xacro:macro name="m"/>'),
    "property in use": at(2, '<xacro:property name="n" value="1"/>').replace('"elbow"', '"${n}"'),
    "include": at(2, '<xacro:include filename="/etc/hostname"/>'),
}


@pytest.mark.parametrize("text", REFUSED.values(), ids=REFUSED.keys())
def test_entities_and_xacro_in_use_stay_refused(text):
    with pytest.raises(UrdfError, match=r"DOCTYPE|not XML|xacro first"):
        parse_urdf(text)


@pytest.mark.parametrize("text", ["<!--" * 100_000, "<!-- -- -->" * 50_000, "<a:b>" * 50_000, " " * 10**6 + "<?xml "])
def test_large_nonsense_is_mended_in_bounded_time(text):
    assert not check_urdf(text).ok  # quadratic time would take minutes


@given(
    st.lists(
        st.sampled_from(
            ["<!-- a -- b -->", "<!--", "-->", "<?xml version='0.0'?>", "<g:a/>", " ", "\n", "<!DOCTYPE a>", "&a;"]
        ),
        max_size=8,
    ),
    st.integers(0, len(CLEAN)),
)
def test_a_mended_robot_is_the_clean_one_or_is_refused(pieces, where):
    text = CLEAN[:where] + "".join(pieces) + CLEAN[where:]
    try:
        root = parse_urdf(text)
    except UrdfError:
        return
    assert root.tag == "robot"
    assert not root.getroottree().docinfo.doctype
    assert len(root.findall("link")) <= 3


@pytest.mark.parametrize(
    ("encoding", "declared", "warns"),
    [
        ("utf-8", "", False),
        ("utf-8-sig", "UTF-8", False),
        ("utf-16", "UTF-16", False),
        ("iso-8859-1", "ISO-8859-1", True),
        ("iso-8859-1", "UTF-8", True),
        ("iso-8859-1", "", True),
        ("cp1252", "windows-1252", True),
    ],
)
def test_files_are_read_in_their_encoding(tmp_path, recwarn, encoding, declared, warns):
    head = f'<?xml version="1.0" encoding="{declared}"?>\n' if declared else "\n"
    text = head + CLEAN.replace("upper", "größe")
    path = tmp_path / "arm.urdf"
    path.write_bytes(text.encode(encoding))
    robot = load_robot(path)
    assert "größe" in robot.frame_names
    told = [str(one.message) for one in recwarn if issubclass(one.category, PathControlWarning)]
    assert bool(told) == warns
    assert all("line 4" in one and "UTF-8" in one for one in told)


def test_a_file_that_is_no_text_is_refused(tmp_path):
    path = tmp_path / "arm.urdf"
    path.write_bytes(b"\x89PNG\0\0")
    with pytest.raises(UrdfError, match="no text"):
        load_robot(path)
    path.write_bytes(bytes(range(1, 256)))
    with pytest.warns(PathControlWarning), pytest.raises(UrdfError, match="not XML"):
        load_robot(path)
