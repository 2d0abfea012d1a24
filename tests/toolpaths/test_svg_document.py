"""SVG documents: what is drawn and what is not, uses, styles, and refusals that say what and where."""

from __future__ import annotations

import numpy as np
import pytest
from drawings import MM_PAGE, samples, svg, write

from pathcontrol.errors import PathControlError, ToolpathError
from pathcontrol.toolpaths.svg.reader import read_svg

LINE = '<path d="M0 0H1"/>'


@pytest.fixture
def read(tmp_path):
    def reader(body, attributes=MM_PAGE, prolog=""):
        return read_svg(write(tmp_path, prolog + svg(body, attributes)))

    return reader


def same(a, b) -> None:
    assert len(a) == len(b)
    for one, other in zip(a, b, strict=True):
        assert np.abs(samples(one) - samples(other)).max() < 1e-15


# --- what is drawn --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "hidden",
    [
        f"<defs>{LINE}</defs>",
        f"<symbol>{LINE}</symbol>",
        f'<clipPath id="c">{LINE}</clipPath>',
        f"<mask>{LINE}</mask>",
        f"<marker>{LINE}</marker>",
        f"<pattern>{LINE}</pattern>",
        f'<g display="none">{LINE}<text>t</text></g>',
        f'<g style="fill:red; display : none !important">{LINE}</g>',
        f'<g visibility="hidden">{LINE}<text>t</text><image href="x.png"/></g>',
        '<rect width="0" height="5"/><circle r="0"/><ellipse rx="4" ry="0"/><path/><polyline/><path d="M3 3z"/>',
        f'<g transform="scale(0 1)">{LINE}</g>',
        f'<g requiredExtensions="http://example.org/">{LINE}</g>',
        f'<x:g xmlns:x="http://example.org/">{LINE}</x:g><!-- {LINE} --><metadata>{LINE}</metadata>',
    ],
)
def test_what_is_hidden_or_only_defined_is_not_cut(read, hidden):
    with pytest.raises(ToolpathError, match="draws no outline"):
        read(hidden)
    assert len(read(hidden + LINE)) == 1


def test_what_is_visible_inside_what_is_hidden_is_cut(read):
    (contour,) = read(f'<g visibility="hidden">{LINE}<path id="seen" visibility="visible" d="M0 0H2"/></g>')
    assert contour.name == "seen"


def test_groups_links_and_switches(read):
    contours = read(f'<a href="http://example.org/">{LINE}</a><switch><g requiredExtensions="x"/><g>{LINE}</g>'
                    f'<path d="M0 0H9"/></switch><line id="last" x2="3"/>')  # fmt: skip
    assert [c.name for c in contours] == ["path 1", "path 2", "last"]
    assert [c.length for c in contours] == pytest.approx([1e-3, 1e-3, 3e-3])


def test_a_file_without_namespace_is_read(tmp_path):
    text = '\ufeff<?xml version="1.0" encoding="ISO-8859-1"?><svg height="1in"><path id="Säge" d="M0 0H96"/></svg>'
    (contour,) = read_svg(write(tmp_path, text))
    assert (contour.name, contour.length) == ("Säge", pytest.approx(0.0254))


# --- uses and viewports ---------------------------------------------------------------------------------------------


def test_a_use_draws_its_target_as_if_it_stood_there(read):
    shape = '<path id="p" transform="rotate(20)" d="M1 2Q3 4 5 0"/>'
    used = read(f'<defs>{shape}</defs><use href="#p" x="3" y="4" transform="scale(2)"/><use xlink:href="#p"/>')
    written = read(f'<g transform="scale(2) translate(3 4)">{shape}</g>{shape}')
    same(used, written)
    assert [c.name for c in used] == ["p", "p"]


def test_uses_of_uses(read):
    chain = f'<g id="a">{LINE}</g>'
    for below, above, dy in (("a", "b", 1), ("b", "c", 2), ("c", "d", 4)):
        chain += f'<g id="{above}"><use href="#{below}"/><use href="#{below}" y="{dy}"/></g>'
    contours = read(f'<defs>{chain}</defs><use href="#d"/>')
    assert np.allclose([50 - c.start[1] * 1e3 for c in contours], np.arange(8))


@pytest.mark.parametrize("tag", ["symbol", "svg"])
def test_symbols_and_nested_drawings_have_a_viewport_of_their_own(read, tag):
    inner = (
        f'<{tag} id="s" viewBox="0 0 10 10" x="1" y="2" width="30%" height="20"><rect width="50%" height="10"/></{tag}>'
    )
    used = read(f'<defs>{inner}</defs><use href="#s" x="10" height="40"/>')
    same(used, read('<rect x="11" y="7" width="15" height="30"/>'))
    if tag == "svg":
        same(read(inner), read('<rect x="6" y="2" width="10" height="20"/>'))


def test_percentages_refer_to_the_nearest_viewport(read):
    drawn = read('<rect x="10%" y="10%" width="50%" height="50%"/><circle r="10%"/>')
    radius = 10 * np.sqrt((100**2 + 50**2) / 2) / 100
    same(drawn, read(f'<rect x="10" y="5" width="50" height="25"/><circle r="{radius}"/>'))


# --- style ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("rules", "left"),
    [
        (".a{display:none}", ["b", "c"]),
        ("#b {display : none}", ["a", "c"]),
        ("path{display:none} .a{display:inline}", ["a"]),
        (".a{display:inline} path{display:none}", ["a"]),
        ("*{visibility:hidden} path.b, #c{visibility:visible}", ["b", "c"]),
        (".a{display:none} .x{display:inline}", ["a", "b", "c"]),
        (".x{display:inline} .a{display:none}", ["b", "c"]),
        (".a{display:none!important} #a{display:inline}", ["b", "c"]),
        ("/* .a{ */ .b /**/ {fill:red;display:none} @font-face{font-display:swap}", ["a", "c"]),
        ("@charset 'utf-8'; g > .a:hover {stroke:red} .c{transform:scale(2)}", ["a", "b", "c"]),
    ],
)
def test_style_sheets_decide_what_is_drawn(read, rules, left):
    shapes = "".join(f'<path id="{name}" class="{name} x" d="M0 0H1"/>' for name in "abc")
    contours = read(f"<style><![CDATA[{rules}]]></style>{shapes}")
    assert [c.name for c in contours] == left
    if "scale" in rules:
        assert contours[2].length == pytest.approx(2e-3)


def test_style_before_sheet_before_attribute(read):
    sheet = "<style>rect{width:20px; x:1px}</style>"
    same(
        read(sheet + '<rect x="9" width="9" height="4" style="x:2;rx:auto"/>'),
        read('<rect x="2" width="20" height="4"/>'),
    )
    same(read('<g style="transform: translate(3px, 4px) rotate(90deg)">' + LINE + "</g>"), read('<path d="M3 4V5"/>'))


# --- refusals -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("body", "words"),
    [
        ('\n\n<text id="t" x="1">hi</text>', ["line 3", "text 't'", "convert text to paths"]),
        ('<image href="http://example.org/x.png"/>', ["image", "no outline"]),
        ("<foreignObject/>", ["foreignObject"]),
        ("<hatch3/>", ["hatch3"]),
        ('<g clip-path="url(#c)"><path d="M0 0H1"/></g>', ["clip-path", "url(#c)"]),
        ('<path style="mask:url(http://example.org/m)" d="M0 0H1"/>', ["mask"]),
        ('<path transform="scale(2)" transform-origin="3 4" d="M0 0H1"/>', ["transform-origin"]),
        ('<path systemLanguage="en" d="M0 0H1"/>', ["systemLanguage"]),
        ("<path style=\"d:path('M0 0H1')\"/>", ["d = "]),
        ('<path d="M0 0L1 2 3"/>', ["3 numbers after L", "2"]),
        ('<path d="M0 0 L 1 2 # 3 4"/>', ["after L", "'# 3 4'"]),
        ('<path d="L1 1"/>', ["'L1 1'", "M or m"]),
        ('<path d="M0 0V"/>', ["0 numbers after V"]),
        ('<path d="M0 0z3 4"/>', ["'3 4' after z"]),
        ('<path d="M0 0A1 1 0 2 0 3 3"/>', ["after A", "flags"]),
        ('<path d="M0 0Lnan 1"/>', ["after L", "numbers"]),
        ('<path d="M0 0L1,,2"/>', ["expected numbers"]),
        ('<path d="M0 0L1e999 1"/>', ["1e999", "too large"]),
        ('<path d="M0 0L1e9 1"/>', ["1e+06 m", "unit"]),
        ('<circle r="-1"/>', ["r = '-1'", "not below 0"]),
        ('<rect width="2em" height="1"/>', ["width = '2em'", "px, mm"]),
        ('<polygon points="1 2 3"/>', ["points has 3 numbers"]),
        ('<path transform="spin(3)" d="M0 0H1"/>', ["spin(3)", "rotate"]),
        ('<path transform="scale(3" d="M0 0H1"/>', ["scale(3"]),
        ('<path transform="translate(1 2 3)" d="M0 0H1"/>', ["translate(1 2 3)"]),
        ('<use href="#nowhere"/>', ["use", "'#nowhere'"]),
        ('<use href="other.svg#a"/>', ["'other.svg#a'", "in this file"]),
        ('<g id="a"><use href="#a"/></g>', ["64 use elements", "itself"]),
        ("<style>g::: .a{display:none}</style>" + LINE, ["style", "'g::: .a'", "display"]),
        ("<style>@media print{path{display:none}}</style>" + LINE, ["@media print"]),
        ('<style media="print">path{display:none}</style>' + LINE, ["@media print"]),
        ("<style>@import url(http://example.org/s.css);</style>" + LINE, ["@import", "not fetched"]),
        ('<svg width="-1">' + LINE + "</svg>", ["width = -1"]),
        ('<svg viewBox="0 0 1 0">' + LINE + "</svg>", ["viewBox", "'0 0 1 0'"]),
        ('<svg viewBox="0 0 1 1" preserveAspectRatio="left">' + LINE + "</svg>", ["preserveAspectRatio", "'left'"]),
    ],
)
def test_what_is_not_understood_is_refused(read, body, words):
    with pytest.raises(ToolpathError) as error:
        read(body)
    assert all(word in str(error.value) for word in ["drawing.svg, line ", *words]), str(error.value)


@pytest.mark.parametrize(
    ("attributes", "words"),
    [
        ("", ["neither a height nor a viewBox"]),
        ('width="10mm" viewBox="0 0 0 5"', ["viewBox", "greater than 0"]),
        ('width="0" height="5" viewBox="0 0 5 5"', ["0 px wide"]),
        ('width="1e3em" height="5"', ["width = '1e3em'"]),
        ('transform="scale(2)" viewBox="0 0 5 5"', ["transform", "outermost"]),
    ],
)
def test_pages_without_a_size(read, attributes, words):
    with pytest.raises(ToolpathError) as error:
        read(LINE, attributes)
    assert all(word in str(error.value) for word in words), str(error.value)


# --- hostile files --------------------------------------------------------------------------------------------------


BOMB = "".join(f'<!ENTITY l{i + 1} "' + f"&l{i};" * 10 + '">' for i in range(9))


@pytest.mark.parametrize(
    ("prolog", "body", "words"),
    [
        (f'<!DOCTYPE s [<!ENTITY l0 "lol">{BOMB}]>', '<path id="&l9;" d="M0 0H1"/>', "entities are refused"),
        ('\n<!DOCTYPE s [<!ENTITY x SYSTEM "file:///etc/passwd">]>', "<g>&x;</g>", "line 2"),
        ('<!DOCTYPE s [<!ENTITY % p SYSTEM "http://example.org/x.dtd"> %p;]>', LINE, "entities are refused"),
        ("", "<g>&lol;</g>", "well-formed"),
        ("", "<g>" * 100_000 + LINE + "</g>" * 100_000, "256 deep; ungroup"),
        ("", "<g>", "well-formed"),
        ('<?xml-stylesheet href="http://example.org/s.css"?>', LINE, "not fetched"),
        ("", '<path d="M0 0' + " " * 5_000_000 + 'x"/>', "after M"),
        ("", '<path d="M' + " " * 5_000_000 + 'x"/>', "after M"),
        ("", '<path d="M0 0A' + " " * 5_000_000 + 'x"/>', "after A"),
        ("", '<path d="M0 0A' + "1 1 0 0 0 1 1 " * 100_000 + 'x"/>', "after A"),
        ("", f'<path transform="{"a" * 5_000_000}" d="M0 0H1"/>', "transform has"),
        ("", f'<path transform="{" " * 5_000_000}(" d="M0 0H1"/>', "transform has"),
        ("", f'<rect width="1{" " * 5_000_000}!" height="1"/>', "expected a length"),
        ("<!DOCTYPE " * 500_000, LINE, "well-formed"),
        ("", "<style>" + "a," * 500_000 + "a{" + "x:1;" * 500_000 + "}</style>", "more than 500000"),
        ("", "<style>" + "/*" * 1_000_000 + "</style>", "more than 500000"),
        ("", "<style>" + "@a{" * 30_000 + "</style>", "nested too deep"),
    ],
)
def test_hostile_files_end_in_an_error(read, prolog, body, words):
    with pytest.raises(ToolpathError, match=words):
        read(body, prolog=prolog)


def test_a_bomb_of_uses_ends_in_an_error(read, monkeypatch):
    monkeypatch.setattr("pathcontrol.toolpaths.svg.walk._MOST_ELEMENTS", 2000)
    levels = "".join(f'<g id="g{i}">' + f'<use href="#g{i + 1}"/>' * 10 + "</g>" for i in range(12))
    with pytest.raises(ToolpathError, match="more than 2000 elements"):
        read(f'<defs>{levels}<path id="g12" d="M0 0H1"/></defs><use href="#g0"/>')


def test_too_many_segments_end_in_an_error(read, monkeypatch):
    monkeypatch.setattr("pathcontrol.toolpaths.svg.pen.MAX_SEGMENTS", 1000)
    with pytest.raises(ToolpathError, match="more than 1000 segments"):
        read(f'<path d="M0 0{"h1" * 1001}"/>')
    monkeypatch.setattr("pathcontrol.toolpaths.drawing.pieces.MAX_SEGMENTS", 1000)
    for body in (f'<path d="M0 0{"h1" * 501}"/>' * 2, f'<path d="M0 0{"q1 1 2 0" * 101}"/>', '<circle r="1"/>' * 101):
        with pytest.raises(ToolpathError, match="more than 1000 lines, or 100 curves"):
            read(body)


def test_a_public_doctype_is_not_fetched(read):
    dtd = '<!DOCTYPE svg PUBLIC "-//W3C//DTD SVG 1.1//EN" "http://127.0.0.1:9/svg11.dtd">'
    assert len(read(LINE, prolog=dtd)) == 1


def test_two_hundred_thousand_lines_in_one_path(read):
    (contour,) = read(f'<path d="M0 0l{"1e-4 0 " * 200_000}"/>')
    assert contour.points == 200_001
    assert contour.length == pytest.approx(0.02)


@pytest.mark.parametrize("content", ["", "hello", "<html/>", '<svg xmlns="http://example.org/"/>', "\0"])
def test_other_files(tmp_path, content):
    path = write(tmp_path, content)
    with pytest.raises(PathControlError, match=r"drawing\.svg"):
        read_svg(path)
    with pytest.raises(PathControlError, match=r"missing\.svg"):
        read_svg(tmp_path / "missing.svg")
