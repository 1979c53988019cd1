"""Docstrings as the site reads them, which are shorter than NumPy's: an entry `name : what it is` has no type of its own."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any

from griffe import Extension

if TYPE_CHECKING:
    from griffe import Object

SECTION = re.compile(r"^(?:Parameters|Raises)\n-+\n(?:.+(?:\n|$))+", re.MULTILINE)
ENTRY = re.compile(r"^(\S.*?) : ", re.MULTILINE)


class EntriesWithoutType(Extension):
    """Put the text of an entry below its name, so that its type is that of the signature, or of the field of a struct."""

    def on_object(self, *, obj: Object, **_: Any) -> None:
        """Change the docstring of one object before it is read."""
        if obj.docstring is None:
            return
        text = SECTION.sub(lambda found: ENTRY.sub(r"\1\n    ", found[0]), obj.docstring.value)
        obj.docstring.value = text.replace("Parameters\n----------", "Attributes\n----------") if obj.is_class else text
