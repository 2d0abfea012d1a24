"""Safe parsing of a text into a ``<robot>`` element."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator
from hashlib import sha256
from typing import NamedTuple

from lxml import etree

from pathcontrol.errors import UrdfError
from pathcontrol.robot.urdf.checks.finding import Finding, quote
from pathcontrol.robot.urdf.xml.mending import mend, parser
from pathcontrol.robot.urdf.xml.prolog import COMMENT, INSTRUCTION, end_of_prolog

MAX_BYTES = 64 * 2**20
_LONGEST = 200  # characters of a message of the parser that are shown

_NO_DOCTYPE = "a DOCTYPE may define entities and is refused; expected none, remove it"
_RUN_XACRO = "run xacro first and load what it prints"


class Parsed(NamedTuple):
    """The ``<robot>`` element of a URDF, the findings about repairs of its XML, and a digest of its text."""

    root: etree._Element
    findings: tuple[Finding, ...]
    digest: bytes


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
    return parse_and_mend(text).root


def parse_and_mend(text: str) -> Parsed:
    """Parse as :func:`parse_urdf` does, and return the findings about repairs as well."""
    data = _encode(text)
    if text.startswith("<!DOCTYPE", end_of_prolog(text, COMMENT, INSTRUCTION)):  # before the parser sees it
        raise UrdfError(_NO_DOCTYPE)
    root, findings = _parse(text, data)
    if root.getroottree().docinfo.doctype:
        raise UrdfError(_NO_DOCTYPE)
    _refuse_other_roots(root)
    using = set(filter(_uses_xacro, _own_elements(root)))
    if not using:
        findings += _without_stray_xacro(root)
    _refuse_xacro(root, using)
    findings += _without_old_version(root)
    return Parsed(root, tuple(findings), sha256(data).digest())


def _encode(text: str) -> bytes:
    """Check that a text is not empty, is Unicode and of bounded length; return its bytes."""
    if not text.strip("\ufeff \t\r\n"):
        raise UrdfError("the file is empty; expected a URDF, that is XML with the root <robot>")
    try:
        data = text.encode()
    except UnicodeEncodeError as error:
        message = f"character {error.start} is not Unicode; save the file as UTF-8"
        raise UrdfError(message, value=error.start) from None
    if len(data) > MAX_BYTES:
        raise UrdfError(
            f"the file has {len(data)} bytes; expected at most {MAX_BYTES}", value=len(data), limit=MAX_BYTES
        )
    return data


def _parse(text: str, data: bytes) -> tuple[etree._Element, list[Finding]]:
    """Parse a text, repaired if it is malformed."""
    try:
        return etree.fromstring(data, parser()), []
    except etree.XMLSyntaxError as error:
        better, findings = mend(text)
        if not findings:
            raise _not_xml(error) from None
    try:
        return etree.fromstring(better.encode(), parser()), findings
    except etree.XMLSyntaxError as error:
        raise _not_xml(error) from None


def _not_xml(error: etree.XMLSyntaxError) -> UrdfError:
    """Return the error about malformed XML."""
    reason = str(error.msg).splitlines()[0][:_LONGEST]  # it repeats names and values of the file
    advice = _RUN_XACRO if "xacro" in reason else "correct that line"
    return UrdfError(f"line {error.lineno}: not XML: {reason}; {advice}", line=error.lineno)


def _without_stray_xacro(root: etree._Element) -> list[Finding]:
    """Remove definitions of xacro, which nothing in the robot uses; other readers ignore them too."""
    stray = [child for child in root.iterchildren(etree.Element) if _is_definition(child)]
    for element in stray:
        root.remove(element)  # removes the blank text behind it as well
    if not stray:
        return []
    lines = f"line {stray[0].sourceline}" + (f" and {len(stray) - 1} more" if len(stray) > 1 else "")
    message = f"{lines}: <xacro:{etree.QName(stray[0]).localname}> is passed over, as nothing uses it; remove it"
    return [Finding("warning", "xml-xacro", "file", message)]


def _is_definition(element: etree._Element) -> bool:
    """Return whether an element defines a property or an argument of xacro."""
    name = etree.QName(element)
    return "xacro" in (name.namespace or "") and name.localname in ("property", "arg")


def _uses_xacro(element: etree._Element) -> bool:
    """Return whether an element has a substitution of xacro."""
    return "${" in " ".join(element.attrib.values())


def _without_old_version(root: etree._Element) -> list[Finding]:
    """Remove a URDF version below 1, which some exporters write and readers ignore."""
    version = root.get("version", "")
    if re.fullmatch(r"0(\.\d{1,9})?", version) is None:
        return []
    del root.attrib["version"]
    message = f"line {root.sourceline}: there is no URDF version {quote(version)}, read as 1.0; remove it"
    return [Finding("warning", "xml-version", "file", message)]


def _refuse_xacro(root: etree._Element, using: Collection[etree._Element]) -> None:
    """Refuse a robot with macros of xacro, or with elements ``using`` its substitutions."""
    for element in root.iter(etree.Element):
        namespace, _, name = element.tag.rpartition("}")
        if "xacro" in namespace or element in using:
            raise UrdfError(
                f"line {element.sourceline}: <{name}> is xacro, not URDF; {_RUN_XACRO}", line=element.sourceline
            )


def _refuse_other_roots(root: etree._Element) -> None:
    """Refuse a root other than ``<robot>``, and elements in a default namespace."""
    if etree.QName(root).localname != "robot":
        raise UrdfError(
            f"line {root.sourceline}: the root is {quote(root.tag)}; expected <robot>", line=root.sourceline
        )
    for element in _own_elements(root):
        if element.tag.startswith("{") and (element is root or element.prefix is None):
            name = etree.QName(element)
            namespace = quote(name.namespace)
            raise UrdfError(
                f"line {element.sourceline}: <{name.localname}> is in the XML namespace {namespace}; "
                "expected none, remove that xmlns",
                value=name.namespace,
                line=element.sourceline,
            )


def _own_elements(root: etree._Element) -> Iterator[etree._Element]:
    """Yield the root and all elements of links, joints and materials, without extensions."""
    yield root
    for child in root.iterchildren(etree.Element):
        if etree.QName(child).localname in ("link", "joint", "material"):
            yield from child.iter(etree.Element)
