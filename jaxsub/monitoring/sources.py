"""Where lines come from: a file, standard input, datagrams of UDP or a serial device."""

import os
import re
import socket
import sys
from collections.abc import Iterator
from pathlib import Path

from ..errors import InputError, optional

STANDARD_INPUT, UDP, SERIAL = "-", "udp://", "serial:"
_LARGEST = 65536  # bytes of a datagram
_BAUD = 115200


def lines_of(source: str) -> Iterator[str]:
    """The whole lines of `source`, as they arrive; of a file until its end. A last line without its end is no line.

    `source` is a path, `-`, `udp://HOST:PORT`, at which datagrams of one or several lines are received, or
    `serial:DEVICE` or `serial:DEVICE@BAUD`. What is not UTF-8 has replacement characters, which no reader takes.

    **Raises** `InputError` for a source that cannot be opened.
    """
    try:
        if source.startswith(UDP):
            yield from _datagrams(source)
        elif source.startswith(SERIAL):
            yield from _of_bytes(_serial(source))
        elif source == STANDARD_INPUT:
            yield from _of_bytes(sys.stdin.fileno())
        else:
            yield from _of_bytes(os.open(Path(source), os.O_RDONLY))
    except OSError as error:
        raise InputError(source, f"cannot be read ({error.strerror or error})", "give another source") from error


def is_file(source: str) -> bool:
    """Whether `source` is a path, whose lines are the same whenever they are read."""
    return source != STANDARD_INPUT and not source.startswith((UDP, SERIAL))


def _of_bytes(descriptor: int) -> Iterator[str]:
    # not by TextIO, which waits for a block of a pipe or a device to be full
    left = b""
    while piece := os.read(descriptor, _LARGEST):
        *lines, left = (left + piece).split(b"\n")
        # of what never ends a line memory would grow
        left = left[-_LARGEST:]
        yield from (line.decode("utf-8", "replace") for line in lines)


def _datagrams(source: str) -> Iterator[str]:
    found = re.fullmatch(r"udp://(\[[^\]]+\]|[^:/]*):(\d{1,5})/?", source)
    if not found or int(found[2]) > 65535:
        raise InputError(source, "is no address", "write udp://HOST:PORT, as udp://127.0.0.1:9000")
    host = found[1].strip("[]")
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    with socket.socket(family, socket.SOCK_DGRAM) as receiver:
        receiver.bind((host, int(found[2])))
        while True:
            yield from receiver.recv(_LARGEST).decode("utf-8", "replace").splitlines()


def _serial(source: str) -> int:
    """A descriptor of a serial device, set to pass bytes as they come."""
    device, _, baud = source.removeprefix(SERIAL).partition("@")
    termios = optional("termios", "watch", "reading a serial device")
    speed = getattr(termios, f"B{baud or _BAUD}", None)
    if speed is None:
        raise InputError(source, f"{baud!r} is no speed of a serial device", "write 9600, 57600 or 115200")
    descriptor = os.open(device, os.O_RDONLY | os.O_NOCTTY)
    try:
        flags = termios.tcgetattr(descriptor)
        flags[0] = flags[1] = flags[3] = 0
        flags[2] = termios.CS8 | termios.CREAD | termios.CLOCAL
        flags[4] = flags[5] = speed
        termios.tcsetattr(descriptor, termios.TCSANOW, flags)
    except termios.error as error:
        raise InputError(
            source, f"is no serial device ({error.args[-1]})", "give a device such as /dev/ttyUSB0"
        ) from error
    return descriptor
