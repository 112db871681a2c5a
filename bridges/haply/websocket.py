"""As much of RFC 6455 as text messages over a local connection need, for client and server."""

from __future__ import annotations

import base64
import hashlib
import os
import socket
import struct
from typing import Optional

_KEY = "258EAFA5-E914-47DA-95CA-C5AB0DC85B11"  # of RFC 6455, 1.3
_TEXT, _CLOSE, _PING, _PONG = 1, 8, 9, 10
#: Longer messages are refused, bytes.
MOST = 1 << 20


class WebSocketError(Exception):
    """The other side does not speak the protocol, or has gone."""


class WebSocket:
    """One connection."""

    def __init__(self, connection: socket.socket, is_client: bool, rest: bytes = b"") -> None:
        self._socket = connection
        self._is_client = is_client
        self._rest = bytearray(rest)
        connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)

    @classmethod
    def connect(cls, host: str, port: int, timeout_s: float) -> "WebSocket":
        connection = socket.create_connection((host, port), timeout_s)
        key = base64.b64encode(os.urandom(16)).decode()
        lines = [
            "GET / HTTP/1.1",
            f"Host: {host}:{port}",
            "Upgrade: websocket",
            "Connection: Upgrade",
            f"Sec-WebSocket-Key: {key}",
            "Sec-WebSocket-Version: 13",
        ]
        connection.sendall(("\r\n".join(lines) + "\r\n\r\n").encode())
        head, rest = _head(connection)
        if not head.startswith("HTTP/1.1 101") or _accept(key).lower() not in head.lower():
            raise WebSocketError(f"no WebSocket at {host}:{port}: {head.splitlines()[0]!r}")
        return cls(connection, True, rest)

    @classmethod
    def accept(cls, connection: socket.socket) -> "WebSocket":
        connection.settimeout(5.0)
        head, rest = _head(connection)
        fields = dict(
            (name.strip().lower(), value.strip())
            for name, _, value in (line.partition(":") for line in head.splitlines()[1:])
        )
        if "sec-websocket-key" not in fields:
            raise WebSocketError("a request without a key")
        lines = [
            "HTTP/1.1 101 Switching Protocols",
            "Upgrade: websocket",
            "Connection: Upgrade",
            f"Sec-WebSocket-Accept: {_accept(fields['sec-websocket-key'])}",
        ]
        connection.sendall(("\r\n".join(lines) + "\r\n\r\n").encode())
        return cls(connection, False, rest)

    def send(self, text: str, kind: int = _TEXT) -> None:
        body = text.encode()
        size = len(body)
        mask = 0x80 if self._is_client else 0
        if size < 126:
            head = struct.pack("!BB", 0x80 | kind, mask | size)
        elif size < 1 << 16:
            head = struct.pack("!BBH", 0x80 | kind, mask | 126, size)
        else:
            head = struct.pack("!BBQ", 0x80 | kind, mask | 127, size)
        if self._is_client:
            key = os.urandom(4)
            head, body = head + key, _masked(body, key)
        self._socket.sendall(head + body)

    def receive(self, timeout_s: Optional[float]) -> str:
        """The next text message.

        :raises TimeoutError: if none comes in time.
        :raises WebSocketError: at the end of the connection.
        """
        self._socket.settimeout(timeout_s)
        text = bytearray()
        while True:
            first, second = self._take(2)
            size = second & 0x7F
            if size == 126:
                (size,) = struct.unpack("!H", self._take(2))
            elif size == 127:
                (size,) = struct.unpack("!Q", self._take(8))
            if size > MOST:
                raise WebSocketError("a message is too long")
            key = self._take(4) if second & 0x80 else b""
            body = self._take(size)
            body = _masked(body, key) if key else body
            kind = first & 0x0F
            if kind == _CLOSE:
                raise WebSocketError("the connection was closed")
            if kind == _PING:
                self.send(body.decode("latin-1"), _PONG)
            elif kind in (0, _TEXT):
                text += body
                if first & 0x80:
                    return text.decode()

    def _take(self, count: int) -> bytes:
        while len(self._rest) < count:
            try:
                more = self._socket.recv(65536)
            except socket.timeout:
                raise TimeoutError("no answer in time") from None
            except OSError as error:
                raise WebSocketError(str(error)) from None
            if not more:
                raise WebSocketError("the connection has ended")
            self._rest += more
        taken = bytes(self._rest[:count])
        del self._rest[:count]
        return taken

    def close(self) -> None:
        try:
            self.send("", _CLOSE)
        except OSError:
            pass
        self._socket.close()


def _masked(body: bytes, key: bytes) -> bytes:
    size = len(body)
    whole = int.from_bytes((key * (size // 4 + 1))[:size], "big")
    return (int.from_bytes(body, "big") ^ whole).to_bytes(size, "big")


def _accept(key: str) -> str:
    return base64.b64encode(hashlib.sha1((key + _KEY).encode()).digest()).decode()


def _head(connection: socket.socket) -> "tuple[str, bytes]":
    data = b""
    while b"\r\n\r\n" not in data:
        more = connection.recv(4096)
        if not more or len(data) > 16384:
            raise WebSocketError("no HTTP answer")
        data += more
    head, _, rest = data.partition(b"\r\n\r\n")
    return head.decode("latin-1"), rest
