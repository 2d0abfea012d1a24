"""Random and mutated URDFs are answered by a report that Pinocchio agrees with."""

import numpy as np
import pinocchio as pin
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from test_urdf_check import (
    AXIS,
    BASE,
    INERTIAL,
    LIMIT,
    LOWER,
    find,
    inertial,
    joint,
    link,
    read_by_pinocchio,
    robot,
)

from pathcontrol.robot.urdf import check_urdf

FUZZ = settings(max_examples=150, deadline=None, suppress_health_check=[HealthCheck.too_slow])
VALUES = st.sampled_from(["0", "0.1", "2"])


@given(
    kinds=st.lists(st.sampled_from(["revolute", "prismatic", "fixed"]), min_size=3, max_size=3),
    masses=st.lists(VALUES, min_size=3, max_size=3),
    arms=st.lists(VALUES, min_size=3, max_size=3),
    moments=st.lists(VALUES, min_size=3, max_size=3),
)
@FUZZ
def test_a_mass_matrix_called_singular_is_singular(kinds, masses, arms, moments):
    parts = [BASE]
    for i, (kind, mass, arm, moment) in enumerate(zip(kinds, masses, arms, moments, strict=True)):
        inertia = f'ixx="{moment}" iyy="{moment}" izz="{moment}" ixy="0" ixz="0" iyz="0"'
        parts.append(link(f"l{i}", inertial(mass, inertia, f'<origin xyz="0 0 {arm}"/>')))
        where = f'<origin xyz="0 {arm} 0" rpy="{arm} 0 0"/>'
        parts.append(joint(f"j{i}", f"l{i - 1}" if i else "base", f"l{i}", kind, where + AXIS + LIMIT))
    report = check_urdf(robot(*parts))
    model = read_by_pinocchio(robot(*parts))
    diagonals = [np.diag(pin.crba(model, model.createData(), q * np.ones(model.nq))) for q in (0.0, 0.7, -2.0)]
    if find(report, "no-mass"):
        assert not np.any(diagonals)
        return
    for finding in find(report, "mass-matrix-singular"):
        index = model.joints[model.getJointId(finding.where.split("'")[1])].idx_v
        assert all(abs(diagonal[index]) < 1e-12 for diagonal in diagonals)
    for i, kind in enumerate(kinds):
        if kind == "prismatic" and all(
            diagonal[model.joints[model.getJointId(f"j{i}")].idx_v] == 0 for diagonal in diagonals
        ):
            assert f"joint 'j{i}'" in [finding.where for finding in find(report, "mass-matrix-singular")]


@given(st.text(max_size=300) | st.text(alphabet='<>/="!-?[]& robtlinkje\n', max_size=300))
@FUZZ
def test_any_text_is_answered_by_a_report(text):
    assert not check_urdf(text).ok


RICH = robot(
    BASE,
    link("upper", INERTIAL + '<visual><origin xyz="0 0 1"/><geometry><sphere radius="1"/></geometry></visual>'),
    LOWER,
    joint("shoulder", "base", "upper", "continuous", AXIS + LIMIT),
    joint("elbow", "upper", "lower", "prismatic", '<origin xyz="0 0 0.45" rpy="0 0.1 0"/>' + AXIS + LIMIT),
).replace("><", ">\n<")


@st.composite
def mutated_urdfs(draw):
    """The rich arm with lines deleted, repeated or moved, attributes exchanged, and bytes replaced."""
    lines = RICH.splitlines()
    for _ in range(draw(st.integers(1, 3))):
        i, k = (draw(st.integers(0, len(lines) - 1)) for _ in range(2))
        kind = draw(st.sampled_from(["delete", "repeat", "move", "swap", "number", "noise"]))
        if kind == "delete" and len(lines) > 1:
            del lines[i]
        elif kind == "repeat":
            lines.insert(k, lines[i])
        elif kind == "move":
            lines.insert(k, lines.pop(i))
        elif kind == "swap":
            lines[i], lines[k] = swapped(lines[i], lines[k])
        elif kind == "number":
            lines[i] = replaced_number(lines[i], draw(st.sampled_from(NUMBERS) | st.floats().map(repr)))
        else:
            at = draw(st.integers(0, len(lines[i])))
            noise = draw(st.binary(max_size=4)).decode("latin-1")
            lines[i] = lines[i][:at] + noise + lines[i][at + draw(st.integers(0, 4)) :]
    return "\n".join(lines)


NUMBERS = (
    "",
    "0",
    "-1",
    "nan",
    "-inf",
    "1e999",
    "1e300",
    "1e-320",
    " 1",
    "1 ",
    "0x1",
    "1_0",
    "1 2 3",
    "one",
    "٣",
)


def swapped(one, other):
    """Exchange the last attribute values of two lines."""
    a, b = one.split('"'), other.split('"')
    if len(a) > 1 and len(b) > 1:
        a[-2], b[-2] = b[-2], a[-2]
    return '"'.join(a), '"'.join(b)


def replaced_number(line, number):
    """Replace the first attribute value of a line."""
    parts = line.split('"')
    if len(parts) > 1:
        parts[1] = number
    return '"'.join(parts)


@given(mutated_urdfs())
@settings(FUZZ, max_examples=200)
def test_what_is_accepted_is_read_by_pinocchio(text):
    report = check_urdf(text)
    if report.ok:
        model = read_by_pinocchio(text)
        assert set(model.names[1:]) == set(report.joints)
        angles = pin.neutral(model)
        assert np.isfinite(pin.crba(model, model.createData(), angles)).all()
