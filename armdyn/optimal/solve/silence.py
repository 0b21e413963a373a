"""Keep a solver's output from the terminal: CasADi warns through Python's streams, and has no option."""

import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, TextIO


class _Deaf:
    """A stream that does not hear one thread."""

    def __init__(self, stream: TextIO):
        self._stream, self._thread = stream, threading.get_ident()

    def hear(self) -> None:
        """From now on hear that thread, too: somebody may have kept the stream."""
        self._thread = -1

    def write(self, text: str) -> int:
        """Passed on, if another thread writes."""
        return len(text) if threading.get_ident() == self._thread else self._stream.write(text)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)


@contextmanager
def silence(verbose: bool) -> Iterator[None]:
    """Within it nothing that this thread says is heard, on standard output and error.

    Args:
        verbose: let it be heard.
    """
    if verbose:
        yield
        return
    heard = sys.stdout, sys.stderr
    deaf = _Deaf(sys.stdout), _Deaf(sys.stderr)
    sys.stdout, sys.stderr = deaf
    try:
        yield
    finally:
        for stream in deaf:
            stream.hear()
        if sys.stdout is deaf[0]:
            sys.stdout = heard[0]
        if sys.stderr is deaf[1]:
            sys.stderr = heard[1]
