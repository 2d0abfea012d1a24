"""Regular expressions do without what versions of Python read differently, and read XML's beginning all the same."""

from __future__ import annotations

import ast
import random
import re
from pathlib import Path

import pytest

from pathcontrol.errors import UrdfError
from pathcontrol.robot.urdf.numbers import read_numbers
from pathcontrol.robot.urdf.xml.parse import parse_and_mend, parse_urdf
from pathcontrol.robot.urdf.xml.prolog import COMMENT, INSTRUCTION, end_of_prolog

MODULES = sorted((Path(__file__).parents[2] / "pathcontrol").rglob("*.py"))
ATOMIC = re.compile(r"(?<!\\)(?:[*+?]|[0-9,]\})\+|\(\?>")
ROBOT = '<robot name="a"><link name="base"/></robot>'


def patterns(text):
    """The strings in a module that uses regular expressions, but its docstrings."""
    tree = ast.parse(text)
    docstrings = {ast.get_docstring(node, clean=False) for node in ast.walk(tree) if isinstance(node, ast.Module)}
    for node in ast.walk(tree):
        if isinstance(node, ast.ClassDef | ast.FunctionDef):
            docstrings.add(ast.get_docstring(node, clean=False))
    strings = {node.value for node in ast.walk(tree) if isinstance(node, ast.Constant) and isinstance(node.value, str)}
    return strings - docstrings


@pytest.mark.parametrize("pattern", [r"a++", r"[0-9]*+", r"(?:a|b)?+c", r"a{1,3}+", r"(?>ab)"])
def test_possessive_quantifiers_and_atomic_groups_are_seen(pattern):
    assert ATOMIC.search(pattern)


def test_no_regular_expression_is_possessive_or_atomic():
    """Python 3.11 reads them differently from one release to the next."""
    texts = {path: path.read_text(encoding="utf-8") for path in MODULES}
    using = {path: text for path, text in texts.items() if re.search(r"^import re$", text, re.MULTILINE)}
    assert len(using) > 20
    found = [(path.name, one) for path, text in using.items() for one in patterns(text) if ATOMIC.search(one)]
    assert found == []


PIECES = [*" \n\t", "<!--", "-->", "<!-- a -->", "<?", "?>", "<?a b?>", "<!DOCTYPE", "<robot>", "-", ">", "\ufeff", "x"]
ANY_PROLOG = re.compile(r"\ufeff?(?:\s|<\?(?:(?!\?>).)*\?>|<!--(?:(?!-->).)*-->)*", re.DOTALL)
COMMENTS = re.compile(r"\ufeff?(?:\s|<!--(?:(?!-->).)*-->)*", re.DOTALL)


def test_the_prolog_ends_where_the_grammar_says():
    """Against the grammar as a plain regular expression, in which a piece goes to the first of its ends."""
    rng = random.Random(0)
    for _ in range(3000):
        text = "".join(rng.choices(PIECES, k=rng.randrange(12)))
        assert end_of_prolog(text, COMMENT, INSTRUCTION) == ANY_PROLOG.match(text).end(), text
        assert end_of_prolog(text, COMMENT) == COMMENTS.match(text).end(), text


@pytest.mark.parametrize("before", ["<!-- -->", "<?a?>", " \n", "<!--->-->", "<?b ?><!-- <robot> -->"])
def test_a_doctype_is_refused_wherever_it_may_stand(before):
    for count in (1, 3, 20_000):
        with pytest.raises(UrdfError, match="DOCTYPE"):
            parse_urdf(f"{before * count}<!DOCTYPE a [<!ENTITY b 'c'>]>{ROBOT}")


def test_a_long_prolog_without_its_declaration_is_read():
    text = "<!-- a -->\n" * 50_000
    parsed = parse_and_mend(f"{text}<?xml version='1.0'?>{ROBOT}")
    assert [finding.code for finding in parsed.findings] == ["xml-declaration"]
    assert "line 50001" in parsed.findings[0].message
    with pytest.raises(UrdfError):
        parse_urdf("<!--" * 200_000)


NUMBERS = ["1", "+1.", "-.5", "1e5", "1.5E-03", "01", "0" * 400]
OTHERS = ["", "+", ".", "e5", "1e", "1.e+", "1_0", "٣", "1.2.3", "0x1", "nan", "inf", "1 ", "1" + "0" * 400]


@pytest.mark.parametrize("text", NUMBERS)
def test_numbers_are_read_as_c_reads_them(text):
    assert read_numbers(text, 1) == (float(text),)


@pytest.mark.parametrize("text", OTHERS)
def test_anything_else_is_no_number(text):
    assert read_numbers(text, 1) is None
