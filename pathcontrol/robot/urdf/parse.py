"""From text to a ``<robot>`` element: XML of a robot, and nothing that could do harm."""

from __future__ import annotations

import re
from collections.abc import Iterator

from lxml import etree

from pathcontrol.errors import UrdfError
from pathcontrol.robot.urdf.finding import shown

MAX_BYTES = 64 * 2**20

# only the prolog can hold a DOCTYPE, so this sees every one before the parser does
_DOCTYPE = re.compile(r"\ufeff?(?:\s|<\?.*?\?>|<!--.*?-->)*+<!DOCTYPE", re.DOTALL)
_RUN_XACRO = "run xacro first and load what it prints"


def parse_urdf(text: str) -> etree._Element:
    """Parse a URDF from memory, without touching the network, any other file or any entity.

    Attribute values of the result are normalised as XML asks (a tab or line break becomes a space), which
    Pinocchio's reader does not do by itself: hand it ``etree.tostring(root, encoding="unicode")``.

    Args:
        text: The XML of the robot. Its encoding declaration, if any, is ignored.

    Returns:
        The ``<robot>`` element.

    Raises:
        UrdfError: If the text is empty, too long, not XML, has a DOCTYPE or another root, or is a xacro file.
    """
    data = _encoded(text)
    if _DOCTYPE.match(text):
        raise UrdfError("a DOCTYPE may define entities and is refused; expected none, remove it")
    root = _parsed(data)
    _refuse_xacro(root)
    _refuse_other_roots(root)
    return root


def _encoded(text: str) -> bytes:
    if not text.strip("\ufeff \t\r\n"):
        raise UrdfError("the file is empty; expected a URDF, that is XML with the root <robot>")
    try:
        data = text.encode()
    except UnicodeEncodeError as error:
        message = f"character {error.start} is not Unicode; save the file as UTF-8"
        raise UrdfError(message) from None
    if len(data) > MAX_BYTES:
        raise UrdfError(f"the file has {len(data)} bytes; expected at most {MAX_BYTES}")
    return data


def _parsed(data: bytes) -> etree._Element:
    parser = etree.XMLParser(encoding="utf-8", resolve_entities=False, no_network=True, load_dtd=False, huge_tree=False)
    try:
        return etree.fromstring(data, parser)
    except etree.XMLSyntaxError as error:
        reason = str(error.msg).splitlines()[0]
        advice = _RUN_XACRO if "xacro" in reason else "correct that line"
        raise UrdfError(f"line {error.lineno}: not XML: {reason}; {advice}") from None


def _refuse_xacro(root: etree._Element) -> None:
    ours = set(_own_elements(root))
    for element in root.iter(etree.Element):
        name = etree.QName(element)
        is_macro = "xacro" in (name.namespace or "")
        if is_macro or (element in ours and any("${" in value for value in element.attrib.values())):
            raise UrdfError(f"line {element.sourceline}: <{name.localname}> is xacro, not URDF; {_RUN_XACRO}")


def _refuse_other_roots(root: etree._Element) -> None:
    if etree.QName(root).localname != "robot":
        raise UrdfError(f"line {root.sourceline}: the root is {shown(root.tag)}; expected <robot>")
    for element in _own_elements(root):
        name = etree.QName(element)
        if name.namespace and (element is root or element.prefix is None):
            namespace = shown(name.namespace)
            raise UrdfError(
                f"line {element.sourceline}: <{name.localname}> is in the XML namespace {namespace}; "
                "expected none, remove that xmlns"
            )


def _own_elements(root: etree._Element) -> Iterator[etree._Element]:
    """Yield the root and what is inside links, joints and materials: extensions are left out."""
    yield root
    for child in root.iterchildren(etree.Element):
        if etree.QName(child).localname in ("link", "joint", "material"):
            yield from child.iter(etree.Element)
