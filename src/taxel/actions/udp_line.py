"""A UDP socket that is connected to one receiver: the kernel lets nobody else's datagrams in.

Nothing here waits, and nothing raises for the network: a receiver that is not there yet, a port
that refuses or a network that is away cost the datagram alone. Knows nothing about what is sent.

Background of our choices: docs/decisions/0016.
"""

from __future__ import annotations

import errno
import ipaddress
import socket

_PASSING = {errno.ENOBUFS, errno.EMSGSIZE, errno.ECONNREFUSED, errno.EHOSTUNREACH}
"""Errors of a datagram alone; after others the line is connected anew."""
_TRIES = 2
"""Of each datagram: the first may be answered by the error of the datagram before, a third would
say nothing new. Source: our choice."""

Address = ipaddress.IPv4Address | ipaddress.IPv6Address


class UdpLine:
    """Datagrams to and from one address.

    Args:
        address: The receiver's; where it is this machine's loopback, nobody else can reach this.
        port: Its port.
    """

    def __init__(self, address: Address, port: int) -> None:
        mapped = address.ipv4_mapped if isinstance(address, ipaddress.IPv6Address) else None
        address = mapped or address
        self._six = address.version == 6
        self._own = ("::1" if self._six else "127.0.0.1") if address.is_loopback else ""
        self._to = (str(address), port)
        self._closed = self._connected = False
        self._port = 0
        self.returned = 0
        """Datagrams that came back: nobody listens at that port. Several at once count as one."""
        self._socket = self._open()

    def send(self, content: bytes) -> bool:
        """Send a datagram; return whether the system took it."""
        if not self._closed and not self._connected:
            self._connect_anew()
        lasting = False
        for _ in range(_TRIES):
            try:
                self._socket.send(content)
            except BlockingIOError:
                return False
            except OSError as error:  # often of the datagram before: this one has not gone yet
                self._count(error)
                lasting = error.errno not in _PASSING
            else:
                return True
        self._connected = self._connected and not lasting
        return False

    def take(self, longest: int, most: int) -> list[bytes]:
        """Return what came since the last call.

        Args:
            longest: Bytes of a datagram; the rest of a longer one is cut.
            most: Datagrams that are taken.
        """
        found: list[bytes] = []
        for _ in range(most):
            try:
                content, sender = self._socket.recvfrom(longest)
                peer = self._socket.getpeername()
            except BlockingIOError:
                break
            except OSError as error:  # of a datagram that was sent, or closed
                self._count(error)
                continue
            if sender[:2] == peer[:2]:  # one from elsewhere may have come before the connection
                found.append(content)
        return found

    def _count(self, error: OSError) -> None:
        self.returned += error.errno == errno.ECONNREFUSED

    def close(self) -> None:
        """Close the socket."""
        self._closed = True
        self._socket.close()

    def _open(self) -> socket.socket:
        opened = socket.socket(socket.AF_INET6 if self._six else socket.AF_INET, socket.SOCK_DGRAM)
        opened.setblocking(False)
        try:
            opened.bind((self._own, self._port))
            opened.connect(self._to)
            self._connected = True
        except OSError:
            self._connected = False
        self._port = opened.getsockname()[1]
        return opened

    def _connect_anew(self) -> None:
        """Take a new socket of the same port: this host's address may be another one now."""
        self._socket.close()
        self._socket = self._open()
