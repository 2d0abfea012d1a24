"""Packets of software in the loop: they come back exactly, and only with their key."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pathcontrol.errors import InputError
from pathcontrol.hardware.sil.packets import LONGEST, Kind, Packet, check_key, read_packet, write_packet

KEY = b"a key of a test, 24 byte"


@given(
    st.sampled_from(Kind),
    st.binary(min_size=8, max_size=8),
    st.integers(0, 2**64 - 1),
    st.lists(st.floats(), max_size=20),
)
@settings(max_examples=60, deadline=None)
def test_packets_come_back_exactly_and_only_with_their_key(kind, session, number, numbers):
    packet = Packet(kind, session, number, np.array(numbers, dtype=float))
    data = write_packet(packet, KEY)
    found = read_packet(data, KEY)
    assert found[:3] == packet[:3]
    np.testing.assert_array_equal(found.numbers, packet.numbers)
    assert read_packet(data, b"another key, of 25 bytes.") is None
    assert read_packet(data + b"\0", KEY) is None
    assert read_packet(data[:-1], KEY) is None


@given(st.binary(max_size=LONGEST + 10), st.data())
@settings(max_examples=60, deadline=None)
def test_what_was_changed_or_made_up_is_no_packet(noise, data):
    assert read_packet(noise, KEY) is None
    whole = bytearray(write_packet(Packet(Kind.TORQUE, bytes(8), 7, np.array([1.0, 2.0])), KEY))
    at = data.draw(st.integers(0, len(whole) - 1))
    whole[at] ^= 1 << data.draw(st.integers(0, 7))
    assert read_packet(bytes(whole), KEY) is None


@pytest.mark.parametrize("host", ["192.168.1.5", "0.0.0.0", "robot.example", "::"])
def test_beyond_this_computer_a_key_is_needed(host):
    with pytest.raises(InputError, match="key"):
        check_key(host, None)
    check_key(host, KEY)
    check_key("127.0.0.1", None)
    check_key("localhost", None)
    with pytest.raises(InputError, match="16"):
        check_key(host, b"short")
