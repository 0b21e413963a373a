"""Address of the server, and who may talk to it."""

import socket

import pytest

from armdyn.errors import ProblemError
from armdyn.show.studio.origins import foreign, free_port, is_loopback


@pytest.mark.parametrize(
    ("host", "hosts", "origins", "refused"),
    [
        ("127.0.0.1", ["127.0.0.1:8080"], [], False),  # the page itself, or a program
        ("127.0.0.1", ["127.0.0.1:8080"], ["http://127.0.0.1:8080"], False),
        ("127.0.0.1", ["localhost:9000"], ["http://localhost:9000"], False),  # a forwarded port
        ("127.0.0.1", ["127.0.0.1:8080"], ["http://127.0.0.1:8000"], True),  # another page of this machine
        ("127.0.0.1", ["127.0.0.1:8080"], ["https://evil.example"], True),
        ("127.0.0.1", ["127.0.0.1:8080"], ["null"], True),
        ("127.0.0.1", ["evil.example:8080"], ["http://evil.example:8080"], True),  # a name that leads here
        ("127.0.0.1", [], [], True),
        ("127.0.0.1", ["[::1"], [], True),
        ("127.0.0.1", ["127.0.0.1:8080"], ["http://["], True),
        ("127.0.0.1", ["127.0.0.1:8080"], ["http://a]b"], True),
        ("0.0.0.0", ["lab.local:8080"], ["http://lab.local:8080"], False),
        ("0.0.0.0", ["lab.local:8080"], ["https://evil.example"], True),
    ],
)
def test_only_the_own_page_may_talk_to_the_server(host, hosts, origins, refused):
    assert foreign(host, hosts, origins) is refused


@pytest.mark.parametrize(
    ("host", "loopback"),
    [("127.0.0.1", True), ("::1", True), ("localhost", True), ("0.0.0.0", False), ("lab.local", False)],
)
def test_the_loopback_address_is_distinguished_from_others(host, loopback):
    assert is_loopback(host) is loopback


def test_the_next_port_is_taken_where_one_is_taken():
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        assert free_port("127.0.0.1", port) > port


def test_an_address_of_another_machine_is_refused():
    with pytest.raises(ProblemError, match="nothing can be served at 192"):
        free_port("192.0.2.1", 8080)
