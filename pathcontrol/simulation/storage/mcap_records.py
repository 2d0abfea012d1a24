"""The records of an MCAP file, read as far as they are whole: a killed process leaves a file without an end."""

from __future__ import annotations

import io
import struct
import zlib
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any, NamedTuple

from pathcontrol._extras import load_extra
from pathcontrol.errors import InputError

if TYPE_CHECKING:
    from mcap.records import Chunk

MAGIC = b"\x89MCAP0\r\n"
_HEAD = struct.Struct("<BQ")  # the kind and the length of a record
_LARGEST = 1 << 28  # bytes of an unpacked chunk
_ATTACHMENT, _CHUNK, _DATA_END = 0x09, 0x06, 0x0F


class Content(NamedTuple):
    """The content of an MCAP file.

    Attributes:
        attachments: by their names.
        channels: metadata of each channel by its number.
        messages: texts of each channel by its number, in their order.
        whole: False for a file without its end.
    """

    attachments: dict[str, bytes]
    channels: dict[int, dict[str, str]]
    messages: dict[int, list[bytes]]
    whole: bool


def load_mcap() -> Any:
    """Return the module that writes MCAP.

    Raises:
        MissingExtraError: it is not installed.
    """
    return load_extra("mcap.writer", "mcap", "a log in MCAP")


def read_content(data: bytes) -> Content:
    """Return the content of a file; checksums are checked.

    Raises:
        InputError: it is no MCAP file, or damaged.
        MissingExtraError: the package ``mcap`` is not installed.
    """
    load_mcap()
    if not data.startswith(MAGIC):
        raise InputError("it is no MCAP file")
    content = Content({}, {}, {}, data.endswith(MAGIC) and len(data) > len(MAGIC))
    reached = len(MAGIC)
    for kind, begin, end in _frame(data):
        if kind == _ATTACHMENT:
            _add_attachment(content, data[begin:end])
        elif kind == _CHUNK:
            _add_chunk(content, data[begin:end])
        elif kind == _DATA_END:
            _check_crc(zlib.crc32(data[: begin - _HEAD.size]), data[begin:end], "the file")
            return content
        reached = end
    if content.whole:
        raise InputError(f"it is damaged: no record begins at its byte {reached}", value=reached)
    return content


def _frame(data: bytes) -> Iterator[tuple[int, int, int]]:
    """Yield the kind of each whole record, and where its content begins and ends."""
    at = len(MAGIC)
    while at + _HEAD.size <= len(data):
        kind, length = _HEAD.unpack_from(data, at)
        begin = at + _HEAD.size
        if kind == 0 or begin + length > len(data):
            return
        at = begin + length
        yield kind, begin, at


def _add_attachment(content: Content, record: bytes) -> None:
    """Add an attachment to the content."""
    from mcap.data_stream import ReadDataStream
    from mcap.records import Attachment

    _check_crc(zlib.crc32(record[:-4]), record[-4:], "an attachment")
    found = Attachment.read(ReadDataStream(io.BytesIO(record)))
    content.attachments[found.name] = bytes(found.data)


def _add_chunk(content: Content, record: bytes) -> None:
    """Add the channels and messages of a chunk to the content."""
    from mcap.data_stream import ReadDataStream
    from mcap.records import Channel, Chunk, Message
    from mcap.stream_reader import breakup_chunk

    chunk = Chunk.read(ReadDataStream(io.BytesIO(record)))
    _check_size(chunk)
    for found in breakup_chunk(chunk, validate_crc=True):
        if isinstance(found, Channel):
            content.channels[found.id] = dict(found.metadata)
        elif isinstance(found, Message):
            content.messages.setdefault(found.channel_id, []).append(found.data)


def _check_size(chunk: Chunk) -> None:
    """Check that a chunk is not said to be larger than chunks are, before memory is taken for it."""
    if chunk.uncompressed_size > _LARGEST:
        raise InputError(
            f"a chunk of it is said to have {chunk.uncompressed_size} bytes, expected at most {_LARGEST}",
            value=chunk.uncompressed_size,
            limit=_LARGEST,
        )


def _check_crc(found: int, stored: bytes, what: str) -> None:
    """Check a checksum; 0 stands for none."""
    (wanted,) = struct.unpack("<I", stored[:4])
    if wanted not in (0, found):
        raise InputError(f"it is damaged: the checksum of {what} is another one; take another copy of it", value=what)
