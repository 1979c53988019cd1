"""Every page of the documents is followed from top to bottom, and prints what it shows; the gallery
by `test_pictures.py`.

`PYTHONPATH=tests python tests/test_pages.py [PAGE ...]` writes what the commands print now into the
pages.
"""

import re
import sys
import tempfile
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import pytest
from pages import BENCHES, DOCS, ROOT, follow, place_of, read, steps, uses_benches

PAGES = [
    page
    for page in sorted([*DOCS.glob("*.md"), ROOT / "README.md", ROOT / "CONTRIBUTING.md"])
    if any(step.executed for step in steps(page)) and page.name != "gallery.md"
]

LONG = re.compile(
    r"winchcascade (diagnose|blind|demo|compare|batch (?!.*--reports "
    r"none))|diagnose\(|--(html|pdf|figures|physics)|pytest"
)
"""What takes more than some ten seconds of a processor: a page with one of these is followed
with the slow tests.
"""


MANY = 5
"""Commands, each a process of its own, from which on a page is followed with the slow tests."""


def is_long(page: Path) -> bool:
    found = steps(page)
    commands = sum(step.kind in ("console", "sh") for step in found)
    return commands >= MANY or any(
        step.verb == "Put into" or LONG.search(step.executed) for step in found
    )


def parameter(page: Path) -> object:
    marks = [pytest.mark.slow] if is_long(page) else []
    return pytest.param(page, id=page.relative_to(ROOT).as_posix(), marks=marks)


@pytest.mark.parametrize("page", [parameter(page) for page in PAGES])
def test_a_page_prints_what_it_shows(
    page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    if uses_benches(page) and not BENCHES.is_dir():
        pytest.skip("needs ../shared/data/benches, which only the project's own machines have")
    monkeypatch.setenv("MPLBACKEND", "Agg")
    assert follow(page, place_of(page, tmp_path)) == read(page)


def test_the_blocks_of_a_page_are_done_in_their_order_and_show_what_they_print(
    tmp_path: Path,
) -> None:
    page = tmp_path / "page.md"
    page.write_text(FOLLOWED.replace("42", "41"))
    assert follow(page, tmp_path) == FOLLOWED
    assert (tmp_path / "seen").read_text() == "1\n3\n2\n"
    page.write_text("```sh\nfalse\ntrue\n```\n")
    with pytest.raises(AssertionError):
        follow(page, tmp_path)


FOLLOWED = """Save as `seen` once:

```text
1
```

Append to `seen`:

```text
2
```

Put into `seen`:

```diff
 1
+3
```

```console
$ cat seen; printf "%s\\n" $((6 * 7)); false
1
3
2
42
```

```bash
false
```

```pycon
>>> for number in (1, 2):
...     print(number, end="\\n\\n")
1
<BLANKLINE>
2
<BLANKLINE>

>>> number
2
```
"""


def write(page: Path) -> str:
    """Write what the commands of a page print now into it; its name, and whether it changed."""
    with tempfile.TemporaryDirectory() as folder:
        printed = follow(page, place_of(page, Path(folder)))
    changed = printed != read(page)
    page.write_text(printed, encoding="utf-8")
    return f"{page.relative_to(ROOT)}: {'written' if changed else 'as before'}"


if __name__ == "__main__":
    pages = [Path(name).resolve() for name in sys.argv[1:]] or PAGES
    with ProcessPoolExecutor(max_tasks_per_child=1) as workers:
        for outcome in workers.map(write, pages):
            sys.stdout.write(f"{outcome}\n")
