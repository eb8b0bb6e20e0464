"""Ctrl-C and SIGTERM end a command within seconds, also in the midst of a compiled call.

Python handles a signal between two of its own instructions, and a compiled call may take minutes. A thread beside it
learns of the signal at once, gives what runs a few seconds to end by itself, then clears the command's scratch folders
away and ends the process. A call that holds the interpreter's lock holds that thread up too; compilation by XLA and its
programs do not.
"""

import contextlib
import os
import signal
import socket
import sys
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import Future
from typing import Any, TypeVar

import click

from ..storage import abandon

T = TypeVar("T")
INTERRUPTED = 130
GRACE = 3.0  # s that a command is given to end by itself
_SIGNALS = (signal.SIGINT, signal.SIGTERM)
_ANSWERED, _CLOSED = b"\0", b""
_STDERR, _CLOSED_FILE = 2, -1
_APART = "jaxsub interruptible"


class Watch:
    """While the block runs, the first SIGINT or SIGTERM raises `KeyboardInterrupt` in the main thread.

    A process that has not left the block `GRACE` seconds later, or gets a second signal, is ended with exit code 130.
    `message` is what it then says on standard error. Where the signal is `heeded` it is `interrupted` and goes on.
    """

    def __init__(self, message: Callable[[], str]):
        self._message, self.interrupted, self._heed = message, False, False
        self._handlers: dict[int, Any] = {}
        self._terminal = _CLOSED_FILE
        self._word, self._spoken = threading.Lock(), False

    def __enter__(self) -> "Watch":
        # its own, since standard error is turned away while readers of logs run
        with contextlib.suppress(OSError):
            self._terminal = os.dup(_STDERR)
        self._read, self._write = socket.socketpair()
        self._write.setblocking(False)
        for number in _SIGNALS:
            if signal.getsignal(number) != signal.SIG_IGN:  # as where a shell begins it in the background
                self._handlers[number] = signal.signal(number, self._interrupt)
        self._before = signal.set_wakeup_fd(self._write.fileno(), warn_on_full_buffer=False)
        threading.Thread(target=self._wait, daemon=True).start()
        return self

    def __exit__(self, *_: object) -> None:
        signal.set_wakeup_fd(self._before)
        for number, handler in self._handlers.items():
            signal.signal(number, handler)
        self._write.close()
        with contextlib.suppress(OSError):
            os.close(self._terminal)

    def answer(self) -> None:
        """Let the command go on after the first signal, to keep what it has; a second one still ends it."""
        self._write.send(_ANSWERED)

    @contextlib.contextmanager
    def heeded(self) -> Iterator[None]:
        """A block that looks at `interrupted` by itself and ends soon after the first signal; a second one ends all."""
        self._heed = True
        try:
            yield
        finally:
            self._heed = False

    def last_word(self, say: Callable[[], object]) -> None:
        """`say()`, once; where the watching thread is ending the process this one waits for it to do so."""
        with self._word:
            if not self._spoken:
                self._spoken = True
                say()

    def _interrupt(self, *_: object) -> None:
        # a second one would break off what answers the first
        if not self.interrupted:
            self.interrupted = True
            if not self._heed:
                raise KeyboardInterrupt

    def _wait(self) -> None:
        """End the process when it is due, unless the block ends before."""
        interrupted = False
        with self._read as signals:
            while True:
                try:
                    byte = signals.recv(1)
                except TimeoutError:
                    break
                if byte == _CLOSED:
                    return
                if byte == _ANSWERED:
                    signals.settimeout(None)
                elif byte[0] in _SIGNALS:
                    if interrupted:
                        break
                    interrupted = True
                    signals.settimeout(None if self._heed else GRACE)
        # to the end of the process: the main thread, if it ends by itself meanwhile, may not exit in the midst of it
        with self._word:
            abandon()
            if not self._spoken:
                self._say()
            leave(INTERRUPTED)

    def _say(self) -> None:
        with contextlib.suppress(OSError):
            # a spinner has hidden the cursor
            shown = "\x1b[?25h\n" if os.isatty(self._terminal) else ""
            os.write(self._terminal, f"{shown}{self._message()}\n".encode(errors="replace"))


def interruptible(of: Callable[[], T], watch: Watch | None) -> T:
    """`of()`, which an interruption of `watch` leaves at once, though a compiled call of it runs on.

    The caller then keeps what it has, and the process ends by `leave`.
    """
    future: Future[T] = Future()
    context = click.get_current_context(silent=True)  # each thread has its own

    def work() -> None:
        try:
            with context.scope(cleanup=False) if context else contextlib.nullcontext():
                future.set_result(of())
        except BaseException as error:
            future.set_exception(error)

    try:
        # which waits for the thread to begin: a signal may come meanwhile too
        threading.Thread(target=work, name=_APART, daemon=True).start()
        return future.result()
    except KeyboardInterrupt:
        if watch is not None:
            watch.answer()
        raise


def leave(code: int) -> None:
    """End the process; at once, where a call that was left to itself still runs, or this is not the main thread."""
    apart = any(thread.name == _APART for thread in threading.enumerate())
    if apart or threading.current_thread() is not threading.main_thread():
        for stream in (sys.stdout, sys.stderr):
            with contextlib.suppress(OSError, ValueError):
                stream.flush()
        os._exit(code)
    sys.exit(code)
