"""The scripts of a page, and its markup without them."""

import json
import re

from winchcascade.report.render.fonts import template_folder

SCRIPT = re.compile(r"<script([^>]*)>(.*?)</script\b[^>]*>", re.DOTALL | re.IGNORECASE)
DATA = re.compile(r' type="application/json"')


def markup_of(page: str) -> str:
    """A page without its scripts and their contents, which are no markup."""
    return SCRIPT.sub("", page)


def check_scripts(page: str) -> None:
    """Fail if a page holds a script that is neither its own nor JSON, which no browser executes."""
    scripts = SCRIPT.findall(page)
    executed = [text for attributes, text in scripts if not DATA.fullmatch(attributes)]
    own = [(template_folder() / name).read_text(encoding="utf-8") for name in ("uplot.js", "page.js")]
    assert executed in (own, own[1:])
    for attributes, text in scripts:
        if DATA.fullmatch(attributes):
            json.loads(text)
            assert "<" not in text
    assert "<script" not in markup_of(page).lower()
