"""MSP, Betaflight's serial protocol: frames, and the status with its arming-disable flags."""

from __future__ import annotations

import struct
from collections.abc import Callable
from functools import reduce
from operator import xor

from aerobat.errors import SpecError
from aerobat.links.betaflight.packets import ReceiverProtocol

STATUS_EX, SET_RAW_RC = 150, 200
_FROM_BOARD, _REFUSED = b"$M>", b"$M!"
_HEAD = 5  # bytes before the payload: three of the preamble, its size, the code
# from the firmware's src/main/fc/runtime_config.c, bit by bit
ARMING_DISABLE_FLAGS = (
    "NOGYRO", "FAILSAFE", "RXLOSS", "NOT_DISARMED", "BOXFAILSAFE", "RUNAWAY", "CRASH", "THROTTLE", "ANGLE",
    "BOOTGRACE", "NOPREARM", "LOAD", "CALIB", "CLI", "CMS", "BST", "MSP", "PARALYZE", "GPS", "RESCUE_SW",
    "DSHOT_TELEM", "REBOOT_REQD", "DSHOT_BBANG", "NO_ACC_CAL", "MOTOR_PROTO", "FLIP_SWITCH", "ALT_HOLD_SW",
    "POS_HOLD_SW", "ARM_SWITCH",
)  # fmt: skip


def request(code: int, payload: bytes = b"") -> bytes:
    """Return the frame of a request to a board, with a payload of at most 255 bytes."""
    return _framed(b"$M<", code, payload)


MSP = ReceiverProtocol(lambda counts: request(SET_RAW_RC, struct.pack(f"<{len(counts)}H", *counts)))


def _framed(head: bytes, code: int, payload: bytes) -> bytes:
    body = bytes([len(payload), code]) + payload
    return head + body + bytes([reduce(xor, body)])


def response(data: bytes, code: int) -> bytes | None:
    """Return the payload of the first complete answer to a request in received bytes, None if none is.

    Raises SpecError for an answer that the board does not know the request.
    """
    begin = 0
    while (begin := data.find(b"$M", begin)) >= 0:
        frame = data[begin:]
        if len(frame) >= len(_FROM_BOARD) and not frame.startswith((_FROM_BOARD, _REFUSED)):
            begin += 1
            continue
        size = frame[3] if len(frame) >= _HEAD else 0
        if len(frame) < _HEAD + size + 1:
            return None
        payload = frame[_HEAD : _HEAD + size]
        whole = frame[: _HEAD + size + 1]
        if whole == _framed(_REFUSED, code, payload):
            raise SpecError(f"the board does not know MSP request {code}; update its firmware")
        if whole == _framed(_FROM_BOARD, code, payload):
            return payload
        begin += 1
    return None


def flags_of(status: bytes) -> tuple[str, ...]:
    """Return the names of the arming-disable flags in a status.

    ARM_SWITCH is left out beside other flags, since it is then set only because the switch requests arming.
    """
    modes = status[15] & 15  # the number of bytes of flight modes beyond the first four
    (bits,) = struct.unpack_from("<I", status, 17 + modes)
    names = [name for bit, name in enumerate(ARMING_DISABLE_FLAGS) if bits >> bit & 1]
    return tuple(name for name in names if name != "ARM_SWITCH" or len(names) == 1)


def arming_disable_flags(exchange: Callable[[bytes, Callable[[bytes], bool]], bytes]) -> tuple[str, ...]:
    """Return the arming-disable flags of a board.

    Args:
        exchange: sends bytes, and returns the answer once a predicate of the answer is true.
    """
    answer = exchange(request(STATUS_EX), lambda data: response(data, STATUS_EX) is not None)
    payload = response(answer, STATUS_EX)
    assert payload is not None, "it was waited for"
    return flags_of(payload)
