"""The packets between a control loop and a machine: authenticated, numbered, and of one session.

A packet is a head, numbers as little-endian doubles, and the first 16 bytes of their HMAC-SHA256 by a shared key.
Whatever has another length, head or code is no packet.
"""

from __future__ import annotations

import hashlib
import hmac
import struct
from enum import IntEnum
from ipaddress import ip_address
from typing import NamedTuple

import numpy as np

from pathcontrol._arrays import Array
from pathcontrol.errors import InputError

_MAGIC = b"pcS1"
_HEAD = struct.Struct("<4sBB8sQ")  # magic, kind, count of numbers, session, number
_CODE = 16  # bytes
_SHORTEST_KEY = 16  # bytes
LONGEST = _HEAD.size + 8 * 255 + _CODE


class Kind(IntEnum):
    """The kinds of packets."""

    HELLO = 0  # of the loop: I am here
    STATE = 1  # of the machine: t, q, q̇
    TORQUE = 2  # of the loop: the answer to the state of the same number
    BYE = 3  # of the loop: put the brakes on


class Packet(NamedTuple):
    """A packet.

    Attributes:
        kind: what it says.
        session: random bytes by which packets of an earlier session are known, (8,).
        number: a count that grows from packet to packet.
        numbers: (k,).
    """

    kind: Kind
    session: bytes
    number: int
    numbers: Array


def write_packet(packet: Packet, key: bytes) -> bytes:
    """Return the bytes of a packet."""
    numbers = np.ascontiguousarray(packet.numbers, dtype="<f8")
    body = _HEAD.pack(_MAGIC, packet.kind, len(numbers), packet.session, packet.number) + numbers.tobytes()
    return body + _authenticate(body, key)


def read_packet(data: bytes, key: bytes) -> Packet | None:
    """Return the packet of some bytes, ``None`` where they are none, or have not been made with the key."""
    if not _HEAD.size + _CODE <= len(data) <= LONGEST:
        return None
    body, code = data[:-_CODE], data[-_CODE:]
    magic, kind, count, session, number = _HEAD.unpack_from(body)
    if magic != _MAGIC or len(body) != _HEAD.size + 8 * count:
        return None
    if not hmac.compare_digest(code, _authenticate(body, key)) or kind not in Kind.__members__.values():
        return None
    return Packet(Kind(kind), session, number, np.frombuffer(body, dtype="<f8", offset=_HEAD.size).astype(np.float64))


def check_key(host: str, key: bytes | None) -> None:
    """Check that an address is of this computer, or that there is a key.

    Raises:
        InputError: it is not.
    """
    try:
        here = ip_address("127.0.0.1" if host == "localhost" else host).is_loopback
    except ValueError:  # the name of a computer
        here = False
    if not here and key is None:
        raise InputError(
            f"{host} is not this computer: a key is needed, so that nobody else moves the arm",
            argument="key",
        )
    if not isinstance(key, bytes | None):
        raise InputError(f"the key is a {type(key).__name__}, expected bytes: secrets.token_bytes(32)", argument="key")
    if key is not None and len(key) < _SHORTEST_KEY:
        raise InputError(
            f"the key has {len(key)} bytes, expected {_SHORTEST_KEY} or more",
            argument="key",
            value=len(key),
            limit=_SHORTEST_KEY,
        )


def _authenticate(body: bytes, key: bytes) -> bytes:
    """Return the code of a body."""
    return hmac.digest(key, body, hashlib.sha256)[:_CODE]
