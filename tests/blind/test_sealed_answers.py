"""The seal: what was dealt is what is scored."""

from pathlib import Path

import pytest
from small_trials import answer, sealed_trial

from winchcascade.blind.cases import SEALED, TRIAL, open_seal, read_trial
from winchcascade.core.errors import OptionError


def test_sealed_answers_are_read_as_they_were_written(tmp_path: Path) -> None:
    put = (answer("case-0001", "single", {"ke_shift": 1.0}), answer("case-0002", "none"))
    _, sealed = open_seal(sealed_trial(tmp_path / "trial", *put))
    assert sealed.answers == put


def test_a_changed_answer_is_rejected(tmp_path: Path) -> None:
    folder = sealed_trial(tmp_path / "trial", answer("case-0001", "single", {"ke_shift": 1.0}))
    path = folder / SEALED
    path.write_text(path.read_text().replace("ke_shift", "ke_rolloff"))
    with pytest.raises(OptionError, match="answers were changed after the cases were dealt"):
        open_seal(folder)


def test_a_missing_answer_file_is_named(tmp_path: Path) -> None:
    folder = sealed_trial(tmp_path / "trial", answer("case-0001", "none"))
    (folder / SEALED).unlink()
    with pytest.raises(OptionError, match=r"sealed\.json: cannot be read"):
        open_seal(folder)


@pytest.mark.parametrize(
    "content",
    [b"", b"[]", b"{}", b'{"schema": "winchcascade/trial/1"}', b'{"schema": "\xff"}', b'{"a": ' + 9999 * b"["],
)
def test_a_folder_without_a_record_of_a_trial_is_rejected(tmp_path: Path, content: bytes) -> None:
    if content:
        (tmp_path / TRIAL).write_bytes(content)
    with pytest.raises(OptionError, match=r"trial\.json"):
        read_trial(tmp_path)


def test_the_record_of_a_trial_shows_neither_seed_nor_answers(tmp_path: Path) -> None:
    folder = sealed_trial(tmp_path / "trial", answer("case-0001", "single", {"ke_shift": 1.0}))
    text = (folder / TRIAL).read_text()
    assert "seed" not in text
    assert "ke_shift" not in text
