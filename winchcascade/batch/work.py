"""What is done to one log of a batch, wherever it is done."""

from __future__ import annotations

import threading
from pathlib import Path
from typing import Any

import msgspec

from winchcascade.addresses import local_copy
from winchcascade.batch.plan import Work
from winchcascade.cascade.montecarlo import uncertainty
from winchcascade.cascade.reduce import reduce, require_payouts
from winchcascade.files import readable, write_set
from winchcascade.ingest.read import read_run
from winchcascade.report.records import reduction_record
from winchcascade.store import digest_of, with_digest

ENDINGS = ("html", "pdf", "json")
"""Files of one log; the JSON tells that the others are there."""

_DRAWING = threading.Lock()
"""matplotlib's settings are global, and a worker of a cluster may have several threads."""


class Order(msgspec.Struct, frozen=True):
    """One log, the reports that are wanted of it, and the folder to write to; without one the results come back."""

    work: Work
    reports: tuple[str, ...] = ()
    folder: str | None = None
    command: str = ""


class Made(msgspec.Struct, frozen=True):
    """Files made of one log, by their ending; empty where they are written already."""

    name: str
    files: dict[str, bytes]


def reduce_log(order: Order) -> Made:
    """Reduce one log and make its files: reports first, the JSON last, so that a JSON tells that all is there."""
    work = order.work
    with local_copy(work.address) as path:
        run = read_run(
            path,
            rig=work.rig,
            load=work.load,
            load_source=work.load_source,
            about=work.about,
            origin=work.origin,
            table=work.sheet,
        )
    run = msgspec.structs.replace(run, path=readable(work.address))
    reduction = reduce(run, rig=work.rig, window=work.window, cycles=work.cycles)
    require_payouts(reduction)
    found = uncertainty(reduction)
    files: dict[str, bytes] = {}
    account: dict[str, Any] = {}
    if order.reports:
        from winchcascade.report.document import make_report
        from winchcascade.report.model_section import modelled

        model = modelled(reduction)
        account = {"model": model.account}  # the campaign's report draws it
        with _DRAWING:
            report = make_report(reduction, found, model=model, command=order.command)
        if "html" in order.reports:
            from winchcascade.report.html import html_text

            files["html"] = html_text(report).encode()
        if "pdf" in order.reports:
            from winchcascade.report.pdf import pdf_bytes

            files["pdf"] = pdf_bytes(report)
    record: dict[str, Any] = reduction_record(reduction, found)
    digests = {ending: digest_of(content) for ending, content in files.items()}
    made_by = {"key": work.key, "reports": list(order.reports), "files": digests}
    files["json"] = with_digest(record | account, "batch", made_by)
    made = Made(work.name, files)
    if order.folder is None:
        return made
    write_made(made, Path(order.folder))
    return Made(work.name, {})


def write_made(made: Made, folder: Path) -> None:
    """Write the files of one log, all whole before the first is replaced, and remove reports of another result."""
    if made.files:
        outdated = [folder / f"{made.name}.{ending}" for ending in ENDINGS if ending not in made.files]
        write_set({folder / f"{made.name}.{e}": content for e, content in made.files.items()}, without=outdated)
