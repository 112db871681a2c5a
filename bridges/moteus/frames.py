"""Frames of a moteus controller: registers in CAN-FD frames, as text over a serial port (fdcanusb).

Facts from the reference of the controller (github.com/mjbots/moteus, docs/reference.md) and of its
adapter; checked against the vendor's own client.
"""

from __future__ import annotations

import struct
from typing import Dict, List, Optional, Tuple

MODE, POSITION, VELOCITY, TORQUE = 0x000, 0x001, 0x002, 0x003
VOLTAGE, TEMPERATURE, FAULT = 0x00D, 0x00E, 0x00F
COMMAND_POSITION, COMMAND_TORQUE, COMMAND_TIMEOUT = 0x020, 0x022, 0x027
#: Values of MODE.
STOPPED, FAULTED, POSITION_MODE, TIMEOUT_MODE = 0, 1, 10, 11
INT8, INT16, INT32, F32 = range(4)
_FORMATS = [struct.Struct("<b"), struct.Struct("<h"), struct.Struct("<i"), struct.Struct("<f")]
_WRITE, _READ, _REPLY, NOP = 0x00, 0x10, 0x20, 0x50
#: Sizes that a CAN-FD frame can have, bytes.
_SIZES = [*range(9), 12, 16, 20, 24, 32, 48, 64]


class FrameError(Exception):
    """A line or frame that is not what it should be."""


def crc8(data: bytes) -> int:
    """With the polynomial x⁸ + x⁷ + x⁴ + x² + x + 1 of the adapter's text lines, from 0."""
    crc = 0
    for byte in data:
        crc ^= byte
        for _ in range(8):
            crc = (crc << 1) ^ 0x197 if crc & 0x80 else crc << 1
    return crc & 0xFF


_TABLE = [crc8(bytes([value])) for value in range(256)]


def _crc(data: bytes) -> int:
    crc = 0
    for byte in data:
        crc = _TABLE[crc ^ byte]
    return crc


def with_checksum(line: bytes) -> bytes:
    """A line with the checksum that a controller on a plain serial port asks for."""
    line += b" "
    return line + b"*%02X" % _crc(line)


def checked(line: bytes, needs_one: bool) -> bytes:
    """The line without its checksum.

    :raises FrameError: if that is wrong, or missing where one is needed.
    """
    line = line.strip()
    if len(line) > 3 and line[-3:-2] == b"*":
        try:
            right = int(line[-2:], 16) == _crc(line[:-3])
        except ValueError:
            right = False
        if not right:
            raise FrameError("a checksum is wrong")
        return line[:-3].rstrip()
    if needs_one:
        raise FrameError("a checksum is missing")
    return line


def _run(kind: int, resolution: int, first: int, count: int) -> bytes:
    head = kind | resolution << 2
    number = bytes([first & 0x7F | 0x80, first >> 7]) if first > 0x7F else bytes([first])
    return (bytes([head | count]) if count < 4 else bytes([head, count])) + number


def write(resolution: int, first: int, values: List[float]) -> bytes:
    """Sets registers from `first` on."""
    format = _FORMATS[resolution]
    body = b"".join(format.pack(v if resolution == F32 else int(v)) for v in values)
    return _run(_WRITE, resolution, first, len(values)) + body


def read(resolution: int, first: int, count: int) -> bytes:
    """Asks for registers from `first` on."""
    return _run(_READ, resolution, first, count)


def reply(resolution: int, first: int, values: List[float]) -> bytes:
    """The answer to that."""
    format = _FORMATS[resolution]
    body = b"".join(format.pack(v if resolution == F32 else int(v)) for v in values)
    return _run(_REPLY, resolution, first, len(values)) + body


def parse(data: bytes) -> "Tuple[Dict[int, float], List[Tuple[int, int, int]], Dict[int, float]]":
    """Of a frame: registers written, those asked for (resolution, first, count), and answers."""
    written: Dict[int, float] = {}
    asked: List[Tuple[int, int, int]] = []
    answers: Dict[int, float] = {}
    at = 0

    def number() -> int:
        nonlocal at
        value = shift = 0
        while True:
            byte = data[at]
            at += 1
            value |= (byte & 0x7F) << shift
            shift += 7
            if not byte & 0x80:
                return value

    try:
        while at < len(data):
            head = data[at]
            at += 1
            if head == NOP:
                continue
            kind, resolution, count = head & 0xF0, (head >> 2) & 3, head & 3
            if kind not in (_WRITE, _READ, _REPLY):
                raise FrameError(f"an unknown part 0x{head:02x} of a frame")
            count = count or number()
            first = number()
            if kind == _READ:
                asked.append((resolution, first, count))
                continue
            into = written if kind == _WRITE else answers
            format = _FORMATS[resolution]
            for register in range(first, first + count):
                (into[register],) = format.unpack_from(data, at)
                at += format.size
    except (IndexError, struct.error):
        raise FrameError("a frame is too short") from None
    return written, asked, answers


def padded(data: bytes) -> bytes:
    """With as many empty parts as a CAN-FD frame needs."""
    if len(data) > _SIZES[-1]:
        raise FrameError("a frame is too long")
    size = next(size for size in _SIZES if size >= len(data))
    return data + bytes([NOP]) * (size - len(data))


def send_line(target: int, data: bytes, uart: bool) -> bytes:
    """`can send` to a controller, which shall answer."""
    line = b"can send %04x %s bF" % (0x8000 | target, padded(data).hex().upper().encode())
    return (with_checksum(line) if uart else line) + b"\n"


def received(line: bytes, uart: bool) -> "Optional[Tuple[int, bytes]]":
    """Sender and data of a line `rcv`, ``None`` for the line `OK`.

    :raises FrameError: for an error of the adapter, and what is no such line.
    """
    line = checked(line, uart)
    if line.startswith(b"OK"):
        return None
    words = line.split()
    if len(words) < 3 or words[0] != b"rcv":
        raise FrameError(f"the adapter says {line.decode('latin-1')!r}")
    try:
        return int(words[1], 16) >> 8 & 0x7F, bytes.fromhex(words[2].decode())
    except ValueError:
        raise FrameError("a line is damaged") from None
