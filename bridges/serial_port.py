"""A serial port: by the system where it can, else by the package `pyserial`."""

from __future__ import annotations

import os
import time
from typing import Optional

try:
    import select
    import termios
except ImportError:  # Windows
    termios = None  # type: ignore[assignment]


class SerialError(Exception):
    """The port cannot be opened, has gone, or does not answer."""


class SerialPort:
    """Lines over a port. Reads wait for a time that is given, writes for half a second."""

    def __init__(self, path: str, baud: int) -> None:
        self._rest = b""
        self._other = None
        if termios is None:
            try:
                import serial
            except ImportError:
                raise SerialError("this system needs the package pyserial") from None
            try:
                self._other = serial.Serial(path, baud, timeout=0.0, write_timeout=0.5)
            except (OSError, ValueError) as error:
                raise SerialError(f"{path}: {error}") from None
            return
        try:
            self._file = os.open(path, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
            _raw(self._file, baud)
        except (OSError, termios.error) as error:
            raise SerialError(f"{path}: {error}") from None

    def write(self, data: bytes) -> None:
        """Writes all of it.

        :raises SerialError: if the port does not take it.
        """
        if self._other is not None:
            try:
                self._other.write(data)
            except OSError as error:
                raise SerialError(str(error)) from None
            return
        until = time.monotonic() + 0.5
        view = memoryview(data)
        while view:
            try:
                view = view[os.write(self._file, view) :]
            except BlockingIOError:
                if time.monotonic() > until:
                    raise SerialError("the port takes no data") from None
                select.select([], [self._file], [], 0.05)
            except OSError as error:
                raise SerialError(str(error)) from None

    def line(self, timeout_s: float) -> Optional[bytes]:
        """The next line without its end, or ``None`` if none comes in time.

        :raises SerialError: if the port has gone.
        """
        until = time.monotonic() + timeout_s
        while True:
            line, end, rest = self._rest.partition(b"\n")
            if end:
                self._rest = rest
                return line.rstrip(b"\r")
            left = until - time.monotonic()
            if left < 0.0:
                return None
            self._rest += self._read(left)
            if len(self._rest) > 65536:
                raise SerialError("no lines come, only bytes: is it the right port and rate?")

    def drop(self) -> None:
        """Forgets what has come so far."""
        while True:
            more = self._read(0.0)
            if not more:
                break
        self._rest = b""

    def _read(self, wait_s: float) -> bytes:
        if self._other is not None:
            try:
                self._other.timeout = wait_s
                return self._other.read(max(1, self._other.in_waiting))
            except OSError as error:
                raise SerialError(str(error)) from None
        try:
            ready, _, _ = select.select([self._file], [], [], wait_s)
            data = os.read(self._file, 4096) if ready else b""
        except BlockingIOError:
            return b""
        except OSError as error:
            raise SerialError(str(error)) from None
        if ready and not data:
            raise SerialError("the port has gone")
        return data

    def close(self) -> None:
        if self._other is not None:
            self._other.close()
        else:
            os.close(self._file)


def _raw(file: int, baud: int) -> None:
    mode = termios.tcgetattr(file)
    mode[0] = mode[1] = mode[3] = 0
    mode[2] = termios.CS8 | termios.CREAD | termios.CLOCAL
    mode[6][termios.VMIN], mode[6][termios.VTIME] = 0, 0
    rate = getattr(termios, f"B{baud}", None)
    if rate is None:
        raise OSError(f"this system does not know a rate of {baud} baud")
    mode[4] = mode[5] = rate
    termios.tcsetattr(file, termios.TCSANOW, mode)
