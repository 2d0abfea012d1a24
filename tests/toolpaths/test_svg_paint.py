"""SVG: what paints nothing is not cut; what cannot be cut is skipped when asked; clip paths that cut nothing off."""

from __future__ import annotations

import numpy as np
import pytest
from drawings import MM_PAGE, svg, write

from pathcontrol.errors import InputError, ToolpathError, UnknownNameError
from pathcontrol.toolpaths.svg import style_sheet as style
from pathcontrol.toolpaths.svg.reader import read_svg

SEEN = '<path id="seen" d="M0 0H10" stroke="black"/>'
INKSCAPE = 'xmlns:inkscape="http://www.inkscape.org/namespaces/inkscape"'


@pytest.fixture
def read(tmp_path):
    def reader(body, attributes=MM_PAGE, **options):
        return read_svg(write(tmp_path, svg(body, attributes)), **options)

    return reader


def ids(toolpath) -> list[str]:
    return [contour.name for contour in toolpath]


UNSEEN = [
    'fill="none"',
    'fill="none" stroke="none"',
    'fill="transparent"',
    'fill="#ff000000"',
    'fill="#f000"',
    'fill="rgba(1, 2, 3, 0)"',
    'fill="rgb(1 2 3 / 0%)"',
    'fill="hsla(120, 50%, 50%, 0)"',
    'opacity="0"',
    'opacity="0%" stroke="black"',
    'fill-opacity="0"',
    'fill="none" stroke="black" stroke-opacity="0"',
    'fill="none" stroke="black" stroke-width="0"',
    'fill="none" stroke="black" stroke-width="0mm"',
    'fill="currentColor" color="transparent"',
    'style="fill:none;"',
    'style="FILL : None; stroke: none !important"',
    'fill="red" style="fill:none"',
    'stroke="red" style="fill:none;stroke:rgba(0,0,0,0)"',
    'fill="none" stroke="#12"',
    'fill="none" stroke="inherit"',
    'class="unseen"',
    'fill="url(#gone)"',
    'fill="url(#gone) none"',
    'style="fill:url(#gone) rgba(0,0,0,0)"',
]


@pytest.mark.parametrize("attributes", UNSEEN)
def test_what_paints_nothing_is_not_cut_but_told(read, attributes):
    shape = '<rect id="no" width="30" height="20" '
    found = read(f"<style>.unseen{{fill:none}}</style>{shape}{attributes}/>{SEEN}")
    assert ids(found) == ["seen"]
    assert any("paints nothing" in note and "rect 'no' (line 1)" in note for note in found.notes)
    group = read(f"<style>.unseen{{fill:none}}</style><g {attributes}>{shape}/></g>{SEEN}")
    assert ids(group) == ["seen"]


SEEN_SOMEHOW = [
    'fill="red"',
    "",
    'fill="none" stroke="#000"',
    'fill="nonsense"',
    'fill="url(#gradient)"',
    'fill="url(#gone) red"',
    'opacity="0.01"',
    'fill="none" stroke="red" stroke-width="1e-3"',
    'fill="none" style="fill:#000"',
    'style="fill:var(--a)"',
    'fill="rgb(0,0,0)"',
    'fill="none" stroke="currentColor"',
    'stroke-width="0"',
    'fill-opacity=".5"',
    'style="fill:bogus;stroke:none"',
    'fill="none" stroke="black" stroke-opacity="50%"',
    'opacity="nonsense"',
]


@pytest.mark.parametrize("attributes", SEEN_SOMEHOW)
def test_what_is_painted_is_cut(read, attributes):
    gradient = '<linearGradient id="gradient"><stop stop-color="red"/></linearGradient>'
    found = read(f'{gradient}<rect id="yes" width="30" height="20" {attributes}/>')
    assert ids(found) == ["yes"]
    assert found.notes == ()


@pytest.mark.parametrize(
    ("outer", "inner", "seen"),
    [
        ('fill="none"', 'fill="inherit"', False),
        ('fill="none"', 'fill="black"', True),
        ('fill="none"', 'fill="initial"', True),
        ('fill="none" stroke="red"', "", True),
        ('fill="none" stroke="red"', 'stroke="none"', False),
        ('fill="none" stroke="red" stroke-width="0"', 'stroke-width="1"', True),
        ('opacity="0"', 'opacity="1"', False),
        ('fill-opacity="0"', 'fill-opacity="1"', True),
        ('style="color:rgba(0,0,0,0)"', 'fill="currentColor"', False),
        ('style="fill:none"', 'style="fill:unset"', False),
    ],
)
def test_paint_is_inherited_as_css_says(read, outer, inner, seen):
    found = read(f'<g {outer}><g><rect id="it" width="3" height="2" {inner}/></g></g>{SEEN}')
    assert ids(found) == ["it", "seen"] if seen else ["seen"]


@pytest.mark.parametrize(
    ("rules", "left"),
    [
        ("g > .a {fill:none}", ["b", "c"]),
        ("g .a, #b {display:none}", ["c"]),
        ("rect:first-child{fill:none}", ["b", "c"]),
        (".a + .b {opacity:0}", ["a", "c"]),
        (".a ~ rect {fill:none}", ["a"]),
        ("[id=c]{visibility:hidden}", ["a", "b"]),
        ("rect:not(.a){fill:none}", ["a"]),
        ("g rect{fill:none} .b{fill:red}", ["b"]),
        (".b{fill:red!important} g rect.b{fill:none}", ["a", "b", "c"]),
        ("@media screen{.a{fill:none}}", ["b", "c"]),
        ("@media (prefers-color-scheme:dark){.a{fill:white}}", ["a", "b", "c"]),
        (":is(.a,.c){fill:none}", ["b"]),
    ],
)
def test_style_sheets_with_any_selectors(read, rules, left):
    shapes = "".join(f'<rect id="{name}" class="{name}" width="3" height="2"/>' for name in "abc")
    assert ids(read(f"<style>{rules}</style><g>{shapes}</g>")) == left


def test_what_is_dashed_or_hidden_is_told(read):
    dashed = read('<path id="fold" d="M0 0H9" stroke="red" style="stroke-dasharray:3,2"/>' + SEEN)
    assert ids(dashed) == ["fold", "seen"]
    assert any("dashed" in note and "'fold'" in note and "cut solid" in note for note in dashed.notes)
    assert read('<path d="M0 0H9" stroke="red" stroke-dasharray="none"/>').notes == ()
    hidden = read(f'<g id="old" display="none"><rect width="3" height="2"/></g>{SEEN}')
    assert any("hidden element" in note and "g 'old'" in note for note in hidden.notes)


def test_many_rules_and_elements_take_a_moment(read, monkeypatch):
    """Every selector that walks through ancestors or siblings is bounded."""
    monkeypatch.setattr(style, "_MOST_STEPS", 100_000)
    monkeypatch.setattr(style, "_MOST_SELECTORS", 100)
    deep = "<g>" * 200 + '<rect width="1" height="1"/>' * 200 + "</g>" * 200
    with pytest.raises(ToolpathError, match="takes too long"):
        read("<style>x " + "* " * 12 + f"rect{{fill:none}}</style>{deep}")
    with pytest.raises(ToolpathError, match="over 100 selectors"):
        read("<style>" + "a{fill:red}" * 101 + "</style>" + SEEN)


# --- what is left out when asked ------------------------------------------------------------------------------------


TEXT = '<text x="5" y="5">A</text><image href="x.png"/>'


def test_text_and_images_are_skipped_when_asked(read):
    with pytest.raises(ToolpathError, match=r"skip='text'.*unknown='warn'"):
        read(TEXT + SEEN)
    for skip in (("text", "image"), ["TEXT", "image"]):
        found = read(TEXT + SEEN, skip=skip)
        assert (ids(found), found.notes) == (["seen"], ())
    with pytest.raises(ToolpathError, match="image"):
        read(TEXT + SEEN, skip="text")
    assert ids(read(f'<circle r="3"/>{SEEN}', skip="circle")) == ["seen"]
    with pytest.raises(UnknownNameError, match=r"skip: 'texts' is no kind.*'text'"):
        read(SEEN, skip="texts")


def test_unknown_warn_passes_over_what_cannot_be_cut(read):
    found = read(TEXT + SEEN + TEXT, unknown="warn")
    assert ids(found) == ["seen"]
    assert found.notes == (
        "text was passed over 2 times: text (line 1)",
        "image was passed over 2 times: image (line 1)",
    )
    with pytest.raises(ToolpathError, match="M or m"):
        read('<path d="L1 1"/>', unknown="warn")


def test_layers_by_label_and_groups_by_id(read):
    body = (
        f'<g {INKSCAPE} inkscape:groupmode="layer" inkscape:label="Cut" id="layer1" transform="translate(1 0)">'
        f"{SEEN}</g>"
        f'<g {INKSCAPE} inkscape:groupmode="layer" inkscape:label="Old" id="layer2" display="none">'
        f'<path id="old" d="M0 0H5"/><g display="none"><path d="M0 0H7"/></g></g><g id="notes">{TEXT}</g>'
    )
    cut = read(body, layers="Cut")
    assert ids(cut) == ["seen"]
    assert cut[0].start[0] == pytest.approx(1e-3)
    assert ids(read(body, layers=["layer1"])) == ["seen"]
    assert ids(read(body, layers=["Old"])) == ["old"]  # hidden, but asked for; what is hidden inside stays so
    assert ids(read(body, layers=["seen", "layer2"])) == ["seen", "old"]
    with pytest.raises(UnknownNameError, match=r"'Engrave', expected some of 'Cut', 'Old'.*'notes'"):
        read(body, layers="Engrave")
    with pytest.raises(InputError, match="layers"):
        read(body, layers=[3])


def test_gap_joins_subpaths(read):
    square = "".join(
        f'<path d="M{a} {b}L{c} {d}"/>'
        for a, b, c, d in [(0, 0, 9, 0), (9, 9.002, 9.001, 0), (9, 9, 0, 9), (0, 9, 0, 0)]
    )
    assert len(read(square)) == 4
    (one,) = read(square, gap=5e-6)
    assert one.closed
    assert len(read(square, gap=0.5e-6)) == 2
    with pytest.raises(InputError, match="gap"):
        read(square, gap=-1)


def test_doubled_edges_are_told(read):
    found = read('<path id="a" d="M0 0C1 2 3 4 5 0H9"/><path id="b" d="M9 0H5C3 4 1 2 0 0"/>' + SEEN)
    assert [note for note in found.notes if "drawn before" in note and "2 times: b" in note]
    assert not read('<path d="M0 0H5V5"/><path d="M0 0V5H5M5 0L0 5"/>').notes


# --- clip paths and masks -------------------------------------------------------------------------------------------


CLIPPED = '<g {0}><path id="in" d="M10 10H20M0 0C30 0 99 5 99 50" stroke="black"/><circle cx="50" cy="25" r="25"/></g>'
WHOLE = [
    '<clipPath id="c"><rect width="100" height="50" fill="white"/></clipPath>',
    '<clipPath id="c"><path d="M0 0H100V50H0z"/></clipPath>',
    '<clipPath id="c" transform="translate(-5 -5)"><polygon points="0,0 0,60 110,60 110,0"/></clipPath>',
    '<clipPath id="c"><circle cx="50" cy="25" r="56"/></clipPath>',
    '<rect id="page" x="-9" width="100" height="50"/><clipPath id="c"><use href="#page" x="9"/></clipPath>',
    '<clipPath id="c"><rect width="1" height="1"/><rect width="100" height="50"/></clipPath>',
    '<clipPath id="c" clipPathUnits="objectBoundingBox"><rect width="1" height="1"/></clipPath>',
]


def test_a_shape_without_length_is_told(read):
    """An arc from a point to itself draws nothing, by the specification, whatever was meant."""
    found = read('<path id="whole" d="M10 10A5 5 0 1 1 10 10"/>' + SEEN)
    assert found.notes == ("a shape without length was passed over once: path 'whole' (line 1)",)


@pytest.mark.parametrize("clip", WHOLE)
@pytest.mark.parametrize("outer", ["", 'transform="rotate(30) scale(2 -1)"'])
def test_a_clip_path_that_cuts_nothing_off_is_no_obstacle(read, clip, outer):
    drawn = f"<g {outer}>" + CLIPPED.format('clip-path="url(#c)"') + f"</g><defs>{clip}</defs>"
    assert ids(read(drawn)) == ["in/1", "in/2", "circle 2"]


@pytest.mark.parametrize(
    "clip",
    [
        '<clipPath id="c"><rect width="98" height="50"/></clipPath>',
        '<clipPath id="c"><rect width="100" height="49.9"/></clipPath>',
        '<clipPath id="c"><circle cx="50" cy="25" r="54"/></clipPath>',
        '<clipPath id="c"><rect width="50" height="50"/><rect x="50" width="50" height="50"/></clipPath>',
        '<clipPath id="c"><path d="M0 0H100V50H0zM20 20V30H30V20z"/></clipPath>',
        '<clipPath id="c"><path d="M0 0H100V50H50L49 1 48 50H0z"/></clipPath>',
        '<clipPath id="c"><text>A</text></clipPath>',
        '<clipPath id="c"></clipPath>',
        '<clipPath id="c" clipPathUnits="objectBoundingBox"><rect width=".9" height="1"/></clipPath>',
        '<rect id="c" width="100" height="50"/>',
    ],
)
def test_a_clip_path_that_may_cut_something_off_is_refused(read, clip):
    with pytest.raises(ToolpathError, match=r"clip.path"):
        read(f"<defs>{clip}</defs>" + CLIPPED.format('clip-path="url(#c)"'))


@pytest.mark.parametrize(
    ("mask", "whole"),
    [
        ('<mask id="m"><rect width="100" height="50" fill="white"/></mask>', True),
        ('<mask id="m" style="mask-type:alpha"><rect width="100" height="50"/></mask>', True),
        ('<mask id="m"><rect width="100" height="50"/></mask>', False),
        ('<mask id="m"><rect width="100" height="50" fill="none"/></mask>', False),
        ('<mask id="m" maskUnits="userSpaceOnUse" width="100" height="50" x="0" y="0"><rect width="100" height="50" '
         'fill="#D9D9D9"/></mask>', True),
        ('<mask id="m" maskUnits="userSpaceOnUse" width="90" height="50" x="0" y="0"><rect width="100" height="50" '
         'fill="#D9D9D9"/></mask>', False),
    ],
)  # fmt: skip
def test_masks_that_hide_nothing(read, mask, whole):
    drawn = mask + CLIPPED.format('mask="url(#m)"')
    if whole:
        assert len(read(drawn)) == 3
    else:
        with pytest.raises(ToolpathError, match="mask"):
            read(drawn)


def test_random_circles_in_a_turned_clip(read):
    """A circle is inside a rectangle if its centre is farther from each side than its radius."""
    rng = np.random.default_rng(5)
    clip = '<clipPath id="c"><rect x="20" y="10" width="40" height="20"/></clipPath>'
    for _ in range(60):
        x, y, r = rng.uniform(20, 60), rng.uniform(10, 30), rng.uniform(1, 9)
        margin = min(x - 20, 60 - x, y - 10, 30 - y) - r
        body = f'{clip}<g transform="rotate(20)"><g clip-path="url(#c)"><circle cx="{x}" cy="{y}" r="{r}"/></g></g>'
        if margin >= 0:
            assert len(read(body)) == 1
        else:
            with pytest.raises(ToolpathError, match="cuts part of it off"):
                read(body)


@pytest.mark.parametrize(
    "text", ["<text/>", '<text x="3"> </text>', "<text><tspan/>\n</text>", "<flowRoot><flowPara/></flowRoot>"]
)
def test_texts_without_words_are_no_obstacle(read, text):
    assert ids(read(text + SEEN)) == ["seen"]


def test_a_kind_that_is_not_there_is_answered_by_those_that_are(read):
    with pytest.raises(UnknownNameError, match=r"'txt' is no kind .* 'text', .* a type such as 'circle'") as caught:
        read("<text>a</text>" + SEEN, skip=["txt"])
    assert "3dface" not in str(caught.value)
