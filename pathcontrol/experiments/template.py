"""The commented experiment file to start from: what its classes take, with what their signatures and docstrings say."""

from __future__ import annotations

import inspect
import re
from collections.abc import Callable, Iterator
from importlib import resources
from typing import Any, get_args

from pathcontrol.arguments import Form, Parameter, parameters_of
from pathcontrol.registry import DISTURBANCES, LAWS, LOOPS, TASKS

_KINDS = {"task": TASKS, "controller": LAWS, "loop": LOOPS, "disturbance": DISTURBANCES}
_COLUMN, _LONGEST = 34, 84  # where comments begin, and how long they are
#: what may stand for an argument of which neither the file nor the signature has a value
_VALUES = {
    Form.TEXT: '"tool"',
    Form.JOINT: "0",
    Form.NUMBERS: "[0.0, 0.0]",
    Form.WHOLES: "[0, 1]",
    Form.GAIN: "[10.0, 10.0]",
    Form.LIMITS: "true",
    Form.WHOLE: "1",
}
_HEAD = re.compile(r"(?P<off>#?)\[(?P<section>\w+)\]")
_KEY = re.compile(r"#?(?P<key>\w+) = (?P<value>[^#]*?) *(?P<comment>#.*)?")


def example_text() -> str:
    """Return the paper's first experiment as an experiment file, with every option explained."""
    text = resources.files("pathcontrol.experiments").joinpath("template.toml").read_text(encoding="utf-8")
    made: list[str] = []
    before = ""
    for block in [_explain_block(block, text) for block in (*text.rstrip("\n").split("\n\n"), "")]:
        section = _section(block)
        if before in _KINDS and section != before:
            made += [_make_table(before, name) for name in _list_left_out(before, "\n".join(made))]
        made.append(block)
        before = section
    return "\n\n".join(made[:-1]) + "\n"


def _section(block: str) -> str:
    """Return the table that a block of the file is."""
    match = _HEAD.match(block)
    return match["section"] if match else ""


def _list_left_out(section: str, text: str) -> Iterator[str]:
    """Yield the names of the classes that the text does not show."""
    yield from (name for name in _KINDS[section].members if f' = "{name}"' not in text)


def _make_table(section: str, name: str) -> str:
    """Return a table for a class that the file does not show, turned off."""
    key = "mode" if section == "loop" else "type"
    return _explain_block(f'#[{section}]\n#{key} = "{name}"', "")


def _explain_block(block: str, text: str) -> str:
    """Return a block with comments, and with the arguments of its class that are nowhere in the ``text``, or needed."""
    head, lines = _HEAD.match(block), block.split("\n")
    kind = _KINDS.get(head["section"]) if head else None
    named = re.search(r'(?m)^#?(?:type|mode) = "(\w+)"', block)
    target = kind.find(named[1]) if kind and named else None
    if target is None:
        return block
    assert kind is not None
    shown = {match["key"] for line in lines if (match := _KEY.fullmatch(line))}
    for name, parameter in parameters_of(target).items():
        missing = name not in (*shown, *kind.given) and (parameter.required or f"{name} = " not in text)
        if missing and (value := _value(parameter)):
            lines.append(f"#{name} = {value}")
    return "\n".join(_add_comment(line, target) for line in lines)


def _add_comment(line: str, target: Callable[..., Any]) -> str:
    """Return a line with what it means behind it, unless it has a comment."""
    match = _KEY.fullmatch(line)
    if match is None or match["comment"]:
        return line
    comment = summarise_class(target) if match["key"] in ("type", "mode") else explain_argument(target, match["key"])
    return f"{line:<{_COLUMN}} # {comment}" if comment else line


def _value(parameter: Parameter) -> str:
    """Return a value to show as TOML, the default if there is one; empty where nothing can be said."""
    choices = [value for kind in parameter.types for value in get_args(kind) if isinstance(value, str)]
    default = parameter.default
    if isinstance(default, bool | int | float | str) and default not in (float("inf"), 0.0, ""):
        return str(default).lower() if isinstance(default, bool) else repr(default).replace("'", '"')
    if choices:
        return f'"{choices[0]}"'
    return _VALUES.get(parameter.form, "1.0") if parameter.form and parameter.required else ""


def summarise_class(target: Callable[..., Any]) -> str:
    """Return the first sentence of a docstring, as far as a comment has room."""
    return _short((inspect.getdoc(target) or "").partition("\n")[0])


def explain_argument(target: Callable[..., Any], argument: str) -> str:
    """Return what the docstrings of a class and its bases say of an argument, as far as a comment has room."""
    for one in getattr(target, "__mro__", (target,)):
        found = re.search(rf"(?ms)^    {argument}: (.*?)(?=^ {{0,4}}\S|\Z)", inspect.cleandoc(one.__doc__ or ""))
        if found:
            return _short(re.sub(r"\s+", " ", found[1]))
    return ""


def _short(text: str) -> str:
    """Return a text without what is Python's, and without what is too much for a comment."""
    text = re.sub(r":\w+:`\.?([^`]*)`", r"\1", text).replace("``", "")
    text = re.sub(r",? ?(?:shape )?\((?:\*batch, )?[nmNk3](?:, ?[nm3]?)*\)", "", text)  # of arrays
    text = re.sub(r", or for each rollout|(?<= )\[rad[^]]*\] ?", "", text)
    text = re.sub(r" +(?=,)|, or None\b", "", re.split(r"(?<!eq)(?<!eqs)[.;] |[.;]$", text)[0]).strip(" ,")
    while len(text) > _LONGEST and ", " in text:
        text = text.rpartition(", ")[0]
    return text if len(text) <= _LONGEST else ""
