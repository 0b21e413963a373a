"""Ctrl-C, from before the first import to the interpreter's end: exit code 130 and one line.

A `KeyboardInterrupt` is raised only where a command works, and not within an import: there it comes out as another
exception, or not at all, wherever C code looks on. Elsewhere nothing is to be put in order, and the process ends.

Nothing is imported here that takes time, such as typing and contextlib: until `Guard` is there, Ctrl-C is a traceback.
"""

from __future__ import annotations

import _signal  # signal itself turns numbers into names on the way, which takes time
import _thread
import os
import sys
import time

TYPE_CHECKING = False  # as typing has it
if TYPE_CHECKING:
    from types import FrameType, TracebackType
    from typing import NoReturn

INTERRUPTED = 130
"""Exit code."""

SCHEMA = "armdyn-json-1"
"""See `console.SCHEMA`; it is here because this is imported first."""

_ANSWER = (
    '{"schema": "armdyn-json-1", "command": "", "success": false, "status": "interrupted", '
    '"message": MESSAGE, "warnings": []}\n'
)
_SHOW_CURSOR = b"\x1b[?25h"  # a spinner hides it
_NOTHING = "nothing is saved"
_CLEAR_LINE = b"\r\x1b[2K"  # of a spinner


_GRACE = 0.5
"""Time after which a command that is still working reports its step [s]."""


class _State:
    working = False
    """A command is running: an interrupt raises `KeyboardInterrupt` in it."""
    pressed = False
    """Ctrl-C was pressed, and `KeyboardInterrupt` raised."""
    interrupted = False
    """Ctrl-C was pressed while a command was running, perhaps within a solve, which ends without an exception."""
    reported = False
    """The command has reported its end, or is about to."""
    doing = ""
    """The command's current step, in words."""
    saved = ""
    """Results that the command has written, in words."""


class Guard:
    """Context that handles Ctrl-C as this module describes; after it Ctrl-C is ignored until the process ends.

    Another handler of the signal stays, and so does its being ignored (`nohup`, a job in the background).
    """

    def __init__(self) -> None:
        self._listens = False

    def __enter__(self) -> None:
        if _signal.getsignal(_signal.SIGINT) is not _signal.default_int_handler:
            return
        try:
            _signal.signal(_signal.SIGINT, _on_interrupt)
        except ValueError:  # not the main thread, which alone gets signals
            return
        sys.unraisablehook = _on_unraisable
        self._listens = True

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        if not self._listens:
            return
        _signal.signal(_signal.SIGINT, _signal.SIG_IGN)
        if isinstance(error, KeyboardInterrupt):
            leave()
        if isinstance(error, SystemExit) and _State.pressed:  # code that caught it may have changed the exit code
            if not _State.reported:  # it came just before the command's own code, or after it
                leave()
            raise SystemExit(INTERRUPTED) from None


class Raised:
    """Context in which Ctrl-C raises `KeyboardInterrupt`, so that a command can put things in order.

    If that takes a while, a line names the step that is being finished; a second Ctrl-C ends the process at once.
    """

    def __enter__(self) -> None:
        _State.working, _State.reported, _State.saved = True, False, ""
        getattr(sys.modules.get("armdyn.files"), "written_folders", {}).clear()
        if _signal.getsignal(_signal.SIGINT) is _on_interrupt:
            reading, writing = os.pipe()
            os.set_blocking(writing, False)
            _signal.set_wakeup_fd(writing, warn_on_full_buffer=False)
            _thread.start_new_thread(_watch, (reading,))

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        _State.working = False


def set_step(what: str) -> None:
    """Set the command's current step, for the line that follows Ctrl-C.

    Args:
        what: the step in words.
    """
    _State.doing = what


def saved(what: str) -> None:
    """Set the results that are on disk already, for the message after a later Ctrl-C.

    Args:
        what: a sentence such as "the motion is saved in results", and how to go on where the command can.
    """
    _State.saved = what


def kept() -> str:
    """What is on disk, in words: the sentence of `saved`, or the folders of the files that were written."""
    folders = getattr(sys.modules.get("armdyn.files"), "written_folders", ())
    return _State.saved or (f"files that were written are in {', '.join(map(str, folders))}" if folders else _NOTHING)


def message() -> str:
    """The message of a command that Ctrl-C ended."""
    return f"interrupted; {kept()}"


def mark_reported() -> None:
    """Note that the command reports its end: no further line about the interrupt is needed."""
    _State.reported = True


def pressed() -> bool:
    """Whether Ctrl-C was pressed: exceptions since then may be its consequence."""
    return _State.pressed or _State.interrupted


def leave() -> NoReturn:
    """End the process at once, with one line of output."""
    if "--json" in sys.argv:
        # json was imported before anything was saved.
        text = f'"{message()}"' if kept() == _NOTHING else sys.modules["json"].dumps(message())
        _write(1, _ANSWER.replace("MESSAGE", text).encode())
    line = f"armdyn: {message()}\n".encode("utf-8", "backslashreplace")
    _write(2, (_SHOW_CURSOR if os.isatty(2) else b"") + line)
    os._exit(INTERRUPTED)


def _write(number: int, data: bytes) -> None:
    try:  # noqa: SIM105  # contextlib takes time to import
        os.write(number, data)
    except OSError:  # a full disk, a closed pipe: nothing is left to be told
        pass


def _on_interrupt(number: int, frame: FrameType | None) -> None:
    if not _State.working or _State.pressed or _importing(frame):
        leave()
    _State.pressed = True
    raise KeyboardInterrupt


def _watch(signals: int) -> None:
    """Watch for Ctrl-C in a thread: the main thread may be in a library that handles no signals."""
    presses = 0
    while presses < 2:
        presses += os.read(signals, 1) == bytes([_signal.SIGINT])
        _State.interrupted = presses > 0
        time.sleep(_GRACE)
        if presses == 1 and _State.working:
            line = f"armdyn: interrupted; still finishing {_State.doing or 'its work'} (Ctrl-C again ends it at once)\n"
            os.write(2, (_CLEAR_LINE if os.isatty(2) else b"") + line.encode("ascii", "backslashreplace"))
    if _State.working:
        leave()


def _importing(frame: FrameType | None) -> bool:
    while frame is not None:
        if frame.f_code.co_filename.startswith("<frozen importlib"):
            return True
        frame = frame.f_back
    return False


def _on_unraisable(what: sys.UnraisableHookArgs) -> None:
    if isinstance(what.exc_value, KeyboardInterrupt):  # it came while an object was being deleted, say
        leave()
    sys.__unraisablehook__(what)
