"""Addresses for the viewer's web page: whether one is local, and can be listened on."""

from __future__ import annotations

import ipaddress
import socket

from stc.errors import StcError, UsageError

LOOPBACK = "127.0.0.1"


class DisplayError(StcError):
    """There is no display for a window, or no library to open one."""


def is_loopback(host: str) -> bool:
    """Whether an address is a loopback address, which other machines cannot reach."""
    if host == "localhost":
        return True
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False


def require_address(host: str, port: int) -> None:
    """Check that an address can be listened on.

    Raises:
        UsageError: it does not belong to this machine, or the port is in use.
    """
    try:
        family, kind, protocol, _, address = socket.getaddrinfo(
            host, port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE
        )[0]
        with socket.socket(family, kind, protocol) as trial:
            trial.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            trial.bind(address)
    except (OSError, OverflowError) as error:
        where = f"--host {host}" if port == 0 else f"--host {host} --port {port}"
        raise UsageError(f"{where}: {getattr(error, 'strerror', None) or error}") from None
