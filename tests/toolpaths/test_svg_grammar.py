"""The grammars of SVG attributes, held to a parser that reads them character by character."""

from __future__ import annotations

import pytest
from drawings import svg, write
from hypothesis import given, settings
from hypothesis import strategies as st

from pathcontrol.errors import ToolpathError
from pathcontrol.toolpaths.svg.attributes import transform
from pathcontrol.toolpaths.svg.path_data import parse_path
from pathcontrol.toolpaths.svg.reader import read_svg

TAKES = {"m": 2, "l": 2, "h": 1, "v": 1, "c": 6, "s": 4, "q": 4, "t": 2, "a": 7}
BLANK = " \t\n\r\f"


class Reader:
    """Path data by https://www.w3.org/TR/SVG11/paths.html#PathDataBNF, without regular expressions."""

    def __init__(self, text: str) -> None:
        self.text, self.at = text, 0

    def see(self) -> str:
        return self.text[self.at : self.at + 1]

    def take(self, characters: str) -> str:
        begin = self.at
        while self.see() and self.see() in characters:
            self.at += 1
        return self.text[begin : self.at]

    def one(self, characters: str) -> str:
        self.at += (found := bool(self.see()) and self.see() in characters)
        return self.text[self.at - found : self.at]

    def number(self) -> bool:
        self.one("+-")
        whole = self.take("0123456789")
        fraction = self.take("0123456789") if self.one(".") else ""
        if not whole and not fraction:
            return False
        back = self.at
        if self.one("eE"):
            self.one("+-")
            if not self.take("0123456789"):
                self.at = back
        return True

    def valid(self) -> bool:
        self.take(BLANK)
        first = True
        while letter := self.see().lower():
            self.at += 1
            if first and letter != "m":
                return False
            first = False
            self.take(BLANK)
            if letter != "z" and not self.arguments(letter):
                return False
            if letter not in TAKES and letter != "z":
                return False
            self.take(BLANK)
        return True

    def arguments(self, letter: str) -> bool:
        count, comma = 0, False
        while self.see() and (comma or self.see() in "0123456789+-.,"):
            if letter == "a" and count % 7 in (3, 4):
                if not self.one("01"):
                    return False
            elif not self.number():
                return False
            count += 1
            self.take(BLANK)
            comma = bool(self.one(","))
            self.take(BLANK)
        return count > 0 and not comma and count % TAKES.get(letter, 1) == 0


def accepted(data: str) -> bool:
    try:
        parse_path(data)
    except ToolpathError:
        return False
    return True


TOKENS = st.sampled_from(
    [*"MmLlHhVvCcSsQqTtAaZz,,, .eE+-0001123", "\n", "1.5", "-2", ".5", "1e2", "3 4", "5,6", "\xa0"]
)
ROUGHLY = st.lists(TOKENS, max_size=25).map("".join)
NUMBER = st.sampled_from(["1", "-2", ".5", "+3.", "1e1", "0"])
SEPARATOR = st.sampled_from([" ", ",", " , ", "", "\n,", ",,", ", ,"])
COMMANDS = st.sampled_from([*"MLHVCSQTAZ"])


@st.composite
def nearly(draw) -> str:
    """Path data that mostly follow the grammar."""
    data = "M0,0"
    for _ in range(draw(st.integers(0, 3))):
        letter = draw(COMMANDS)
        data += draw(st.sampled_from(["", " ", ","])) + letter + draw(st.sampled_from(["", " ", ","]))
        for k in range(TAKES.get(letter.lower(), 0) * draw(st.integers(1, 2))):
            data += draw(SEPARATOR) if k else ""
            data += draw(st.sampled_from("01")) if letter == "A" and k % 7 in (3, 4) else draw(NUMBER)
    return data


@given(st.one_of(ROUGHLY, ROUGHLY.map(lambda text: "M1 2" + text), nearly()))
@settings(max_examples=150)
def test_path_data_are_taken_exactly_if_they_follow_the_grammar(data):
    assert accepted(data) == Reader(data).valid(), data


BROKEN = ["M0,0 ,L 3 , 4", "M0,0,L3,4", "M,0,0", "M0,,0", "M0 0L1 2,z", "M0 0z,", ",M0 0", "M0 0L1 2 ,", "M0 0L1e 2"]
BROKEN += ["M0 0L\u0661 2", "M0\xa00", "M0 0A1 1 0 0,,1 2 3", "M0 0A1 1 0 0 1 2 3,", "M0 0A1 1 0 01 2", "M0 0L- 1 2"]
BROKEN += ["\xa0", "\xa0M0 0", "M0 0z\xa0", "M0 0 1 2\u2003"]


@pytest.mark.parametrize("data", BROKEN)
def test_broken_path_data_are_refused(data):
    assert not Reader(data).valid()
    with pytest.raises(ToolpathError, match="path data"):
        parse_path(data)


@pytest.mark.parametrize("data", ["M0,0 L 3 , 4", "M0 0A1 1 0 0110 10", "M0 0a1,1 0 01.5.5-1-1 0 1 0 2 2", "M.5.5-1-1"])
def test_valid_path_data_are_read(data):
    assert Reader(data).valid()
    assert parse_path(data)


OTHERS = ['width="1 mm x"', 'width="1..5"', 'width="mm"', 'x="1,2"', 'rx="\u0661"', 'transform="scale(1)) "']
OTHERS += ['transform="scale((1)"', 'transform="scale 1"', 'transform="scale(1,,2)"', 'transform="rotate(1),)"']


@pytest.mark.parametrize("attribute", OTHERS)
def test_other_attributes_are_held_to_their_grammar(tmp_path, attribute):
    given_ = {name: f'{name}="9"' for name in ("width", "height", "rx")} | {attribute.split("=")[0]: attribute}
    with pytest.raises(ToolpathError, match=r"drawing\.svg, line 1, rect"):
        read_svg(write(tmp_path, svg(f"<rect {' '.join(given_.values())}/>")))


def test_forms_of_transforms():
    a = transform("translate(1,2) scale(3)")
    for same in ("translate(1 2),scale(3)", " translate ( 1 , 2 ) , scale(3 3) ", "translate(1px,2px)scale(3)"):
        assert (transform(same) == a).all()
