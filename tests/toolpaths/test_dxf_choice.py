"""DXF: what is left out and told, what is skipped when asked, gaps, doubled edges and crumbs."""

from __future__ import annotations

import json
import warnings

import ezdxf
import pytest
from click.testing import CliRunner
from drawings import dxf_reader
from hypothesis import given, settings
from hypothesis import strategies as st

from pathcontrol.cli import main
from pathcontrol.errors import InputError, PathControlWarning, ToolpathError, UnknownNameError
from pathcontrol.experiments.schema.task_sections import toolpath_section
from pathcontrol.toolpaths.dxf.reader import read_dxf
from pathcontrol.toolpaths.read import read_toolpath

SQUARE = [(0, 0), (10, 0), (10, 10), (0, 10)]


@pytest.fixture(scope="module")
def read(tmp_path_factory):
    return dxf_reader(tmp_path_factory.mktemp("dxf"))


def told(toolpath, *words: str) -> bool:
    return any(all(word in note for word in words) for note in toolpath.notes)


def lines(m, points, closed=True, **attributes) -> None:
    for start, end in zip(points, points[1:] + points[:1] if closed else points[1:], strict=False):
        m.add_line(start, end, dxfattribs=attributes)


@pytest.mark.parametrize(
    ("layer", "change", "words"),
    [
        ("Defpoints", lambda layer: None, "never plotted"),
        ("DEFPOINTS", lambda layer: None, "never plotted"),
        ("aid", lambda layer: layer.dxf.set("plot", 0), "not to be plotted"),
        ("aid", lambda layer: layer.off(), "is off"),
        ("aid", lambda layer: layer.freeze(), "is frozen"),
    ],
)
def test_layers_that_are_not_seen_are_left_out_and_told_or_asked_for(read, layer, change, words):
    def draw(m):
        change(m.doc.layers.get(layer) if layer in m.doc.layers else m.doc.layers.add(layer))
        m.add_line((0, 0), (1, 0))
        m.add_line((0, 1), (2, 1), dxfattribs={"layer": layer})
        m.add_text("aid", dxfattribs={"layer": layer})

    found = read(draw)
    assert [c.length for c in found] == [1]
    assert told(found, repr(layer), words)
    (asked,) = read(draw, layers=[layer], skip="text")
    assert asked.length == 2


def test_invisible_entities_and_dashed_lines_are_told(read):
    def draw(m):
        m.doc.linetypes.add("HIDDEN2", pattern=[0.2, 0.1, -0.1])
        m.doc.layers.add("bend", linetype="HIDDEN2")
        m.add_line((0, 0), (1, 0))
        m.add_line((0, 1), (1, 1), dxfattribs={"invisible": 1})
        m.add_line((0, 2), (1, 2), dxfattribs={"linetype": "HIDDEN2"})
        m.add_line((0, 3), (1, 3), dxfattribs={"layer": "bend"})
        m.add_line((0, 4), (1, 4), dxfattribs={"layer": "bend", "linetype": "Continuous"})

    found = read(draw, unit="mm")
    assert len(found) == 4
    assert told(found, "invisible", "once", "LINE")
    assert told(found, "HIDDEN2", "cut solid", "2 times")


def test_points_text_and_dimensions_are_skipped_when_asked(read):
    def draw(m):
        m.add_line((0, 0), (1, 0))
        m.add_point((0, 0))
        m.add_text("A")
        m.add_mtext("B")
        m.add_linear_dim(base=(0, 2), p1=(0, 0), p2=(1, 0))
        m.add_hatch()
        m.add_circle((5, 5), 1)

    with pytest.raises(ToolpathError, match=r"1 POINT.*skip='POINT,.*unknown='warn'"):
        read(draw)
    everything = ("point", "text", "dimension", "hatch")
    assert [len(read(draw, skip=skip)) for skip in (everything, [*everything, "CIRCLE"])] == [2, 1]
    assert read(draw, skip=everything).notes == ()
    with pytest.raises(ToolpathError, match=r"1 HATCH"):
        read(draw, skip=("point", "text", "dimension"))
    lenient = read(draw, unknown="warn")
    assert len(lenient) == 2
    assert all(told(lenient, kind, "passed over once") for kind in ("POINT", "TEXT", "MTEXT", "DIMENSION", "HATCH"))
    with pytest.raises(UnknownNameError, match=r"skip: 'pionts'.*'point'"):
        read(draw, skip="pionts")
    with pytest.raises(InputError, match="skip"):
        read(draw, skip=[1])


@settings(max_examples=8)
@given(st.floats(1.5e-6, 4.5e-5))
def test_a_gap_that_stays_open_is_told_with_the_option_that_closes_it(read, gap):
    def draw(m):
        m.add_line((0, 0), (1, 0))
        m.add_line((1, gap), (1, 1))
        m.add_lwpolyline([(1, 1), (0, 1), (0, 0)])

    found = read(draw)
    assert len(found) == 1
    assert not found[0].closed
    (note,) = found.notes
    suggested = float(note.split("gap=")[1].split()[0])
    assert gap < suggested <= 1.2 * gap
    closed = read(draw, gap=suggested)
    assert [c.closed for c in closed] == [True]
    assert closed.notes == ()
    assert read(draw, gap=0.9 * gap).notes


def test_wider_gaps_are_not_told_and_none_at_all_may_be_asked_for(read):
    def draw(gap):
        return lambda m: (m.add_line((0, 0), (1, 0)), m.add_line((1, gap), (1, 1)))

    assert read(draw(1e-4)).notes == ()
    assert len(read(draw(1e-4), gap=2e-4)) == 1
    assert len(read(draw(5e-7))) == 1
    assert len(read(draw(5e-7), gap=0)) == 2
    with pytest.raises(InputError, match=r"gap = -1"):
        read(draw(1), gap=-1)


def test_a_large_gap_spares_what_is_smaller_than_itself(read):
    def draw(m):
        lines(m, SQUARE)
        m.add_circle((5, 5), 0.2)
        m.add_line((3, 3), (3.4, 3))

    found = read(draw, gap=0.5)
    assert sorted(round(c.length, 3) for c in found) == [0.4, 1.257, 40]


def test_doubled_edges_are_told(read):
    def doubled(m):
        lines(m, SQUARE)
        m.add_line((10, 0), (0, 0))  # backwards
        m.add_arc((20, 0), 1, 0, 90)
        m.add_arc((20, 0), 1, 0, 90)
        m.add_circle((30, 0), 1)
        m.add_ellipse((30, 0), (0, 1), 1, 0, 6.283185307)
        m.add_lwpolyline([(0, 5), (10, 0), (10, 10)])

    found = read(doubled)
    assert told(found, "drawn before", "4 times")
    plain = read(lambda m: (lines(m, SQUARE), m.add_line((0, 0), (10, 10)), m.add_circle((5, 5), 5)))
    assert not told(plain, "drawn before")


def test_crumbs_are_left_out_and_told_with_the_file(tmp_path):
    document = ezdxf.new("R2010", units=4)
    m = document.modelspace()
    m.add_line((0, 0), (100, 0))
    m.add_line((100, 0), (100.0004, 0))
    m.add_line((100.0004, 0), (100, 50))
    m.add_line((50, 50), (50.0004, 50))
    m.add_circle((20, 20), 1e-4)
    m.add_line((7, 7), (7, 7))
    document.saveas(tmp_path / "crumbs.dxf")
    with pytest.warns(PathControlWarning, match=r"crumbs\.dxf: a curve shorter than 1 µm was left out 3 times"):
        found = read_toolpath(tmp_path / "crumbs.dxf")
    assert [round(c.length, 6) for c in found] == [0.15]
    assert told(found, "without length", "LINE")


def test_a_drawing_of_one_tiny_line_is_read(read):
    (line,) = read(lambda m: m.add_line((0, 0), (4e-7, 0)))
    assert line.length == pytest.approx(4e-7)


HEADS = {"AutoCAD Binary DXF\r\n\x1a\0": "binary DXF.*save it as DXF", "AC1032\0\0": "DWG.*save it as DXF"}


@pytest.mark.parametrize("head", HEADS)
def test_other_kinds_of_drawing_files_are_told_as_such(tmp_path, head):
    path = tmp_path / "part.dxf"
    path.write_text(head)
    with pytest.raises(ToolpathError, match=HEADS[head]):
        read_dxf(path)


def test_nothing_is_told_of_a_plain_drawing(read):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert read(lambda m: (lines(m, SQUARE), m.add_circle((5, 5), 1))).notes == ()


def test_the_options_on_the_command_line_and_in_experiment_files(tmp_path):
    document = ezdxf.new("R2010", units=4)
    m = document.modelspace()
    m.add_line((0, 0), (10, 0))
    m.add_line((10, 0.01), (10, 10))
    m.add_point((0, 0))
    m.add_text("A")
    document.saveas(tmp_path / "part.dxf")
    file = str(tmp_path / "part.dxf")
    refused = CliRunner().invoke(main, ["toolpath", file])
    assert "--skip POINT,TEXT" in refused.output
    assert "--lenient" in refused.output
    for options in (["--skip", "POINT,TEXT"], ["--skip", "point", "--skip", "text"]):
        shown = CliRunner().invoke(main, ["toolpath", file, "--json", *options])
        assert len(json.loads(shown.stdout)["contours"]) == 2
        assert "--gap '0.011 mm'" in shown.output
    joined = CliRunner().invoke(main, ["toolpath", file, "--json", "--lenient", "--gap", "0.011 mm"])
    assert len(json.loads(joined.stdout)["contours"]) == 1
    section = toolpath_section()(file=file, frame="tip", skip=["point", "text"], gap=1.1e-5)
    assert section.reading == {"skip": ["point", "text"], "gap": 1.1e-5}
    assert len(read_toolpath(file, **section.reading)) == 1
