"""The packaged campaign, to try the tool on: simulated logs, rebuilt from a published table,
never measured.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

import msgspec

from winchcascade.batch.reductions import rendered
from winchcascade.batch.results_pages import write_index
from winchcascade.batch.run_batch import REPORTS
from winchcascade.core.errors import OutputError
from winchcascade.core.files import check_replaceable, write_content, write_set
from winchcascade.core.store import (
    CAMPAIGN_PAGE,
    DIAGNOSIS_FILES,
    DIAGNOSIS_RECORD,
    INDEX,
    Output,
    digest_of,
    fingerprint,
    inside,
    locked,
    make_one,
    with_digest,
)
from winchcascade.core.version import __version__

_PACKAGE = Path(__file__).parent.parent


def packaged_campaign() -> Path:
    """Folder of the packaged campaign: inside the package once installed, beside it in a
    checkout.
    """
    installed = _PACKAGE / "demo"
    return installed if installed.is_dir() else _PACKAGE.parent / "fixtures" / "campaign"


def copy_campaign(folder: Path, *, force: bool = False) -> Path:
    """Copy the packaged campaign into a folder, and give its campaign.toml.

    Raises
    ------
    OutputError : a file of that name with another content is there, and `force` does not allow to
        replace it
    """
    make_one(folder)
    for source in sorted(packaged_campaign().iterdir()):
        copy, content = folder / source.name, source.read_bytes()
        if copy.is_file() and copy.read_bytes() == content:
            continue
        if copy.exists() and not force:
            raise OutputError(
                f"{copy}: exists with another content; give --out a new folder or add --force."
            )
        write_content(copy, content, force=True)
    return folder / "campaign.toml"


def diagnosis_output(campaign: Path) -> Output:
    """The diagnosis of a campaign in a folder of results, by a key of this version and the
    content of the logs.
    """
    files = {path.name: fingerprint(path) for path in sorted(campaign.parent.iterdir())}
    key = digest_of(repr((__version__, files)).encode())
    return Output(DIAGNOSIS_RECORD, "store", key, DIAGNOSIS_FILES[:-1])


def diagnosis_of(campaign: Path, command: str) -> dict[str, bytes]:
    """Diagnose a campaign with all effects: its files and its record, by their names.

    Parameters
    ----------
    command : what was typed, for the report
    """
    from winchcascade.batch.campaign_diagnosis import diagnose_listed
    from winchcascade.core.campaign_file import load_campaign
    from winchcascade.report.results.campaign_index import links_to
    from winchcascade.report.results.diagnosis import diagnosis_report
    from winchcascade.report.results.diagnosis_record import as_json
    from winchcascade.rig.effects.catalogue import EFFECTS

    output = diagnosis_output(campaign)
    found = diagnose_listed(load_campaign(campaign), EFFECTS)
    report = diagnosis_report(found, command=command)
    report = msgspec.structs.replace(report, links=links_to([CAMPAIGN_PAGE, INDEX]))
    contents = rendered(report, REPORTS["all"])
    files = {f"diagnosis.{ending}": content for ending, content in contents.items()}
    digests = {name: digest_of(content) for name, content in files.items()}
    record = as_json(found) | {"version": __version__}
    made_by = {"key": output.key, "files": digests}
    return files | {output.record: with_digest(record, output.entry, made_by, indent=1)}


def write_diagnosis(
    folder: Path,
    files: Mapping[str, bytes],
    *,
    force: bool = False,
    on_progress: Callable[[str], None] = lambda _: None,
) -> None:
    """Write the files of a diagnosis into a folder of results, and list them on its page.

    Raises
    ------
    OutputError : a file of that name is not this tool's own, and `force` does not allow to replace
        it
    """
    with locked(
        folder, lambda place: on_progress(f"waiting for another call that works in {place}")
    ):
        paths = {inside(folder, name): content for name, content in files.items()}
        for path in paths:
            check_replaceable(path, force=force)
        write_set(paths)
        write_index(folder)
