"""CRSF, the protocol between receivers and boards of FPV quadrotors: the frame of all channels.

The format is that of Team BlackSheep, github.com/tbs-fpv/tbs-crsf-spec: address, length, type, payload, and a
CRC-8 (DVB-S2) of type and payload; 16 channels of 11 bits each, the first in the lowest bits. The
address of a flight controller is 0xC8.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import reduce

from aerobat.links.betaflight.packets import ReceiverProtocol


def channels_frame(counts: Sequence[int]) -> bytes:
    """Return the frame of 16 channels, each 0 to 2047."""
    packed = reduce(lambda bits, count: bits << 11 | count, reversed(counts), 0)
    body = bytes([0x16]) + packed.to_bytes(22, "little")  # the type RC_CHANNELS_PACKED
    return bytes([0xC8, len(body) + 1]) + body + bytes([crc8(body)])


def crc8(data: bytes) -> int:
    """Return the CRC-8 (DVB-S2) of bytes."""
    crc = 0
    for byte in data:
        crc ^= byte
        for _ in range(8):
            crc = crc << 1 ^ (0xD5 if crc & 0x80 else 0)
        crc &= 0xFF
    return crc


# 172 to 1811 are 988 to 2012 µs; Betaflight's src/main/rx/crsf.c adds half a microsecond
CRSF = ReceiverProtocol(channels_frame, offset=881.0, step=1024.0 / 1639.0, baud=420000)
