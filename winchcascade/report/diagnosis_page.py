"""What the reports of both kinds of diagnosis share: the tiles and points of the first page, the next test, the method."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from winchcascade.report.diagnosis_names import apart_words, probability_words, share_words
from winchcascade.report.diagnosis_words import VERDICTS
from winchcascade.report.report_model import Note, Point, Section, Table, Tile

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from winchcascade.diagnosis.causes import Cause


class Closed(NamedTuple):
    """Share of the gap that is closed, its interval in words, and what it was judged on: logs or cycles."""

    share: float
    interval: str
    on: str


def verdict_tiles(verdict: str, causes: Sequence[Cause], lead: str, closed: Closed | None) -> list[Tile]:
    """Verdict, leading cause, and share that is closed.

    Parameters
    ----------
    lead : the numbers of the leading cause, with their intervals
    """
    count = len(causes)
    none = "nothing stands out" if verdict == "no_gap" else "no cause named"
    tiles = [
        Tile("Verdict", "", VERDICTS[verdict], f"{count} cause{'s' if count > 1 else ''} named" if count else none)
    ]
    if causes:
        sure = f"probability {probability_words(causes[0].probability)}"
        tiles.append(Tile("Leading cause", sure, causes[0].effect, lead))
    if closed is not None:
        tiles.append(
            Tile("Gap closed", f"on unseen {closed.on}", share_words(closed.share), f"95 %: {closed.interval}")
        )
    return tiles


def cause_points(sentences: Sequence[str]) -> list[Point]:
    """One point for each cause, numbered where there are several."""
    many = len(sentences) > 1
    return [Point(f"Cause {k}" if many else "Cause", text) for k, text in enumerate(sentences, start=1)]


def cause_sentence(cause: Cause, meaning: str, numbers: str) -> str:
    """A cause: its name, what it is, its numbers, and what would do in its place."""
    text = f"{cause.effect}: {meaning[:1].lower()}{meaning[1:].rstrip('.')}. Found: {numbers}."
    rivals = " or ".join(rival.effect for rival in cause.rivals)
    return f"{text} Or in its place {rivals}." if rivals else text


def next_section(
    first: Sequence[tuple[str, str]], separates: tuple[str, str], z: float, caption: str, how: str
) -> Section:
    """What to test next.

    Parameters
    ----------
    first : items that tell the run
    separates : the two effects that it tells apart
    z : by how many standard deviations they would differ
    how : what was tried, and how the difference was reckoned
    """
    one, other = separates
    rows = (
        *first,
        ("Tells apart", f"{one} from {other}"),
        ("They would differ by", f"{apart_words(z)} standard deviations"),
    )
    table = Table("experiment", caption, ("Item", "Value"), ("", ""), rows, (0, 1))
    return Section("next", "What to test next", (table, Note(how)))


def method_section(texts: Sequence[str]) -> Section:
    """The method in short; what stands before the first full stop of a paragraph is what it is about."""
    notes = []
    for text in texts:
        about, _, rest = text.partition(". ")
        notes.append(Note(rest, about))
    return Section("method", "Method and its limits", tuple(notes))


def rivals_table(causes: Sequence[Cause], caption: str, apart: Callable[[str], str]) -> Table | None:
    """What would tell each cause from its rivals; None where no cause has any.

    Parameters
    ----------
    apart : how a report writes in what the two differ most
    """
    rows = tuple(
        (cause.effect, rival.effect, probability_words(rival.probability), apart(rival.told_apart_by))
        for cause in causes
        for rival in cause.rivals
    )
    if not rows:
        return None
    head, units = ("Effect", "Rival", "Probability", "They differ most in"), ("", "", "of the rival", "")
    return Table("rivals", caption, head, units, rows, (0, 1, 3))
