"""Address of the studio's server: a free port, and who may talk to it."""

import errno
import ipaddress
import socket
from collections.abc import Sequence
from urllib.parse import urlsplit

from armdyn.errors import ProblemError

_TRIED = 50
"""Number of ports tried, from the requested one on."""


def is_loopback(host: str) -> bool:
    """Whether an address is reached from this machine alone."""
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return host == "localhost"


def free_port(host: str, port: int) -> int:
    """First free port, from a given one on.

    Raises:
        ProblemError: nothing can be served at this address, or all ports that were tried are taken.
    """
    for tried in range(port, min(port + _TRIED, 2**16)):
        try:
            family = socket.getaddrinfo(host, tried, type=socket.SOCK_STREAM)[0][0]
            with socket.socket(family, socket.SOCK_STREAM) as probe:
                probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
                probe.bind((host, tried))
        except OSError as error:
            if error.errno == errno.EADDRINUSE:
                continue
            reason = error.strerror or str(error)
            raise ProblemError(
                f"nothing can be served at {host}, port {tried} ({reason}): host is an address of this machine, such "
                "as 127.0.0.1, and port is from 1024 on"
            ) from None
        return tried
    raise ProblemError(f"the ports {port} to {tried} of {host} are taken: give another --port")


def foreign(host: str, hosts: Sequence[str], origins: Sequence[str]) -> bool:
    """Whether a request comes from another page than the studio's own.

    A page of the internet may open connections to this machine, or have its name lead here: its origin is not the
    address that it asks for, or that address is no name of this machine.

    Args:
        host: that is served.
        hosts: the request's headers Host.
        origins: its headers Origin; programs other than browsers have none.
    """
    if len(hosts) != 1 or len(origins) > 1:
        return True
    try:
        named = urlsplit(f"//{hosts[0]}").hostname or ""
        if any(urlsplit(one).netloc != hosts[0] for one in origins):
            return True
    except ValueError:  # no address, such as http://[
        return True
    return is_loopback(host) and not is_loopback(named)
