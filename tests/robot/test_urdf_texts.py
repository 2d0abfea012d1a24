"""Texts that are no URDF, or hostile, and those that are only unusual."""

import time

import pytest
from test_urdf_check import ARM, AXIS, BASE, LIMIT, SHOULDER, UPPER, elbow, joint, link, read_by_pinocchio, robot

from pathcontrol.errors import UrdfError
from pathcontrol.robot.urdf import check_urdf, parse_urdf

UNREADABLE = {
    "empty": ("", "empty"),
    "blank": ("\ufeff \n\t", "empty"),
    "not XML": ("lower: 1", "line 1"),
    "cut off": (ARM[: len(ARM) // 2], "not XML"),
    "wrong root": ("<sdf/>", "sdf"),
    "namespace": (ARM.replace("<robot", '<robot xmlns="http://example.org"'), "http://example.org"),
    "namespace inside": (ARM.replace("<link", '<link xmlns="urn:x"', 1), "urn:x"),
    "xacro macro": (
        robot('<xacro:macro name="m"/>', attributes='xmlns:xacro="http://ros.org/xacro"'),
        "xacro first",
    ),
    "xacro undeclared": (robot('<xacro:macro name="m"/>'), "xacro first"),
    "xacro property": (elbow('<axis xyz="${axis}"/>' + LIMIT), "xacro first"),
    "surrogate": (ARM.replace("two", "\ud800"), "Unicode"),
    "null": (ARM.replace("two", "\0"), "not XML"),
    "unknown entity": (ARM.replace("two", "&two;"), "two"),
}


@pytest.mark.parametrize(("text", "reason"), UNREADABLE.values(), ids=UNREADABLE.keys())
def test_what_is_no_urdf_is_one_error_with_the_reason(text, reason):
    with pytest.raises(UrdfError, match=reason):
        parse_urdf(text)
    report = check_urdf(text)
    (finding,) = report.findings
    assert (finding.level, finding.code) == ("error", "unreadable")
    assert reason in finding.message
    assert "\n" not in str(finding)


def test_the_line_of_a_syntax_error_is_given():
    lines = ARM.splitlines()
    lines[3] = lines[3].replace('"lower"', "lower")
    with pytest.raises(UrdfError, match="line 4"):
        parse_urdf("\n".join(lines))


LAUGHS = "".join(f'<!ENTITY l{i} "{f"&l{i - 1};" * 10}">' for i in range(1, 12))


HOSTILE = {
    "billion laughs": f'<!DOCTYPE robot [<!ENTITY l0 "ha">{LAUGHS}]><robot name="&l11;"/>',
    "in an element": f'<!DOCTYPE robot [<!ENTITY l0 "ha">{LAUGHS}]><robot name="r">&l11;</robot>',
    "external entity": '<!DOCTYPE robot [<!ENTITY x SYSTEM "file:///secret.txt">]><robot>&x;</robot>',
    "external file": '<!DOCTYPE robot SYSTEM "http://localhost:9/r.dtd"><robot name="r"/>',
    "behind comments": '<?xml version="1.0"?>\n<!-- a --><?p?>\n<!-- b --><!DOCTYPE robot><robot/>',
    "bare": "\ufeff<!DOCTYPE robot>" + ARM,
}


@pytest.mark.parametrize("text", HOSTILE.values(), ids=HOSTILE.keys())
def test_doctypes_and_entities_are_refused_at_once(text):
    start = time.process_time()
    with pytest.raises(UrdfError, match="DOCTYPE"):
        parse_urdf(text)
    assert time.process_time() - start < 5.0  # an entity bomb that goes off takes hours


def test_a_doctype_in_a_comment_is_harmless():
    assert check_urdf(f"<!-- <!DOCTYPE robot> -->{ARM}").findings == ()


@pytest.mark.parametrize(
    "text",
    [
        elbow(AXIS + LIMIT.replace('"10"', f'"{"1" * 200_000}x"')),
        "<!--" * 200_000,
        "<robot" + " " * 200_000,
        robot("<a>" * 100_000),
        robot(*(link(f"l{i}", "") for i in range(5000)), *(joint(f"j{i}", "l0", "l1") for i in range(5000))),
    ],
    ids=["digits", "comments", "blanks", "depth", "joints"],
)
def test_large_nonsense_is_refused_fast(text):
    # bounded work, not a speed claim: quadratic time would take minutes
    start = time.process_time()
    assert not check_urdf(text).ok
    assert time.process_time() - start < 20.0


def test_a_text_over_the_size_limit_is_refused(monkeypatch):
    monkeypatch.setattr("pathcontrol.robot.urdf.xml.parse.MAX_BYTES", len(ARM) - 1)
    with pytest.raises(UrdfError, match=f"{len(ARM)} bytes"):
        parse_urdf(ARM)


@pytest.mark.parametrize("encoding", ["latin-1", "utf-8", "utf-16", "nonsense"])
def test_an_encoding_declaration_does_not_matter_for_text(encoding):
    text = f'<?xml version="1.0" encoding="{encoding}"?>\n' + ARM.replace("two", "Größe")
    assert check_urdf(text).findings == ()
    assert check_urdf(text).name == "Größe"


def test_names_outside_ascii_are_read(capfd):
    text = robot(BASE, UPPER, link("größe"), SHOULDER, joint("ellenbögen", "upper", "größe"), "<ä ö='1'/>")
    text = text.replace('<link name="upper"', '<link name="upper" größe="1"')
    assert check_urdf(text).findings == ()
    assert capfd.readouterr() == ("", "")


def test_tabs_and_line_breaks_in_vectors_are_read_once_normalised():
    text = elbow('<axis xyz="0\t1\n0"/>' + LIMIT)
    assert check_urdf(text).findings == ()
    assert read_by_pinocchio(text).nv == 2
