"""The text of a file in blocks that end where lines end, so that a log of many hours needs no more memory than its numbers."""

from __future__ import annotations

import codecs
import os
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TypeVar

from winchcascade.errors import LogError

BLOCK = 1 << 22
"""Bytes that are parsed at a time."""

Bytes = bytes | memoryview
"""Text as bytes, or a view of a part of it."""

_NEAR = 1 << 20
_WORKERS = max(2, min(8, os.cpu_count() or 2))
_LONGEST_LINE = 1 << 24

Parsed = TypeVar("Parsed")


def in_parallel(parse: Callable[[Bytes], Parsed], blocks: Iterator[Bytes]) -> Iterator[Parsed]:
    """Parse blocks in threads, a few ahead, and hand them on in their order."""
    from collections import deque
    from concurrent.futures import Future, ThreadPoolExecutor

    ahead: deque[Future[Parsed]] = deque()
    with ThreadPoolExecutor(_WORKERS) as pool:
        for block in blocks:
            ahead.append(pool.submit(parse, block))
            if len(ahead) > _WORKERS:
                yield ahead.popleft().result()
        while ahead:
            yield ahead.popleft().result()


def text_blocks(path: Path, encoding: str, skip: int) -> Iterator[Bytes]:
    """Text of a file from line `skip` on in ASCII-compatible bytes, cut where lines end; an unfinished line comes last."""
    rest = b""
    for data in _chunks(path, encoding):
        whole = rest + bytes(data) if skip or (rest and b"\n" not in data[: 1 << 16].tobytes()) else None
        if whole is not None:
            while skip and (end := whole.find(b"\n")) >= 0:
                whole, skip = whole[end + 1 :], skip - 1
            data, rest = memoryview(whole), b""
            if skip:
                rest = whole
                continue
        end = _last_line_end(data)
        if end == 0 and len(rest) + len(data) > _LONGEST_LINE:
            raise LogError(
                f"{path.name}: a line of more than {_LONGEST_LINE >> 20} MB; expected rows of a few numbers."
            )
        if end and rest:
            begin = data[: 1 << 16].tobytes().find(b"\n") + 1
            yield rest + bytes(data[:begin])
            data, end, rest = data[begin:], end - begin, b""
        if end:
            yield data[:end]
        rest += bytes(data[end:])
    if rest and not skip:
        yield rest


def _chunks(path: Path, encoding: str) -> Iterator[memoryview]:
    """The bytes of a file as ASCII-compatible text with line feeds, a block at a time."""
    decoder = codecs.getincrementaldecoder(encoding)(errors="replace") if encoding[:6] in ("utf-16", "utf-32") else None
    old_mac = False
    with path.open("rb") as file:
        left = os.fstat(file.fileno()).st_size
        while True:
            buffer = bytearray(min(BLOCK, max(left, 0) + 1))
            size = file.readinto(buffer)
            if not size:
                return
            left -= size
            data = memoryview(buffer)[:size]
            if data[0] == 0 and not any(buffer[:size].strip(b"\0")):
                data = data[:1]  # one tells as much as the megabytes that a logger reserved and never wrote
            if decoder is not None:
                data = memoryview(decoder.decode(data).encode())
            old_mac = old_mac or (_last_line_end(data) == 0 and b"\r" in data[:_NEAR].tobytes())
            yield memoryview(data.tobytes().replace(b"\r\n", b"\n").replace(b"\r", b"\n")) if old_mac else data


def _last_line_end(data: memoryview) -> int:
    """Position after the last line feed of a block, 0 if there is none."""
    for size in (1 << 12, len(data)):
        found = data[-size:].tobytes().rfind(b"\n") if size else -1
        if found >= 0:
            return max(len(data) - size, 0) + found + 1
    return 0
