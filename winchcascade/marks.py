"""Whether a file is of this tool's making: each kind of file has its mark at one place, and nothing else counts as a mark."""

from __future__ import annotations

import re
from pathlib import Path

LOOK = 1 << 16
"""Bytes at either end of a file among which its mark is sought."""

_SCHEMA = rb"winchcascade/[a-z_]+/\d+"
_VERSION = rb"winchcascade/\d[\w.+-]*"

_HEADS = re.compile(
    rb"\A(?:"
    rb'\{\s*"schema":\s*"' + _SCHEMA + rb'"'
    rb'|<!doctype html>\s*<html lang="en">\s*<head>\s*<meta charset="utf-8">\s*<meta name="generator" content="' + _VERSION
    + rb'"|<\?xml version="1\.0" encoding="utf-8"\?>\s*<testsuites name="winchcascade check"[^<>]*>\s*<testsuite [^<>]*>\s*'
    rb'<properties>\s*<property name="generator" value="' + _VERSION
    + rb'"|# Calibrated by ' + _VERSION
    + rb" from |Time \(s\),[^\n\"'#;]*Generator speed \(rpm\),Stator current \(A rms\),Air-gap torque \(N\.m\)\r?\n"
    rb"|Time \(s\),Cycle,Predicted mechanical power \(W\)\r?\n)"
)  # fmt: skip
"""How files begin: JSON with its schema first, page, JUnit, calibrated rig file, simulated log, predictions."""

_WORKBOOK = re.compile(rb"PK\x05\x06.{16}(?P<size>..)" + _VERSION + rb"\Z", re.DOTALL)
"""How a workbook ends: the comment of its archive."""

_PDF = re.compile(rb"/Author\s*\(" + _VERSION + rb"\)\s*/Creator\s*\(Typst ")
"""Author and program in the properties of a PDF."""


def is_marked(path: Path) -> bool:
    """Whether a file carries this tool's mark where this tool writes it, or is empty.

    Raises
    ------
    OSError : the file cannot be read
    """
    with path.open("rb") as file:
        head = file.read(LOOK)
        size = file.seek(0, 2)
        file.seek(max(0, size - LOOK))
        tail = file.read(LOOK)
    if not head or _HEADS.match(head) is not None:
        return True
    if head.startswith(b"PK\x03\x04"):
        return _WORKBOOK.search(tail) is not None
    if head.startswith(b"%PDF-"):
        return _PDF.search(tail) is not None
    if head.startswith(b"PAR1"):
        return _is_own_parquet(path)
    return head.lstrip().startswith(b"{") and _is_own_json(path)


def _is_own_parquet(path: Path) -> bool:
    import pyarrow as pa
    from pyarrow import parquet

    try:
        about = parquet.read_metadata(path).metadata or {}
    except pa.ArrowException:  # damaged
        return False
    return re.fullmatch(_SCHEMA, about.get(b"schema", b"")) is not None


def _is_own_json(path: Path) -> bool:
    """Whether the schema of a JSON object is this tool's, where it does not stand first, as in the record of a trial."""
    import msgspec

    class Marked(msgspec.Struct):
        schema: str

    try:
        schema = msgspec.json.decode(path.read_bytes(), type=Marked).schema
    except (msgspec.DecodeError, UnicodeDecodeError, RecursionError):
        return False
    return re.fullmatch(_SCHEMA, schema.encode("utf-8", "replace")) is not None
