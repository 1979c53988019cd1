"""An extension of Griffe: descriptions behind a colon in the docstrings of this package.

NumPy's style has `name : type`, and the description below. Types of this package stand in the
signatures alone, and a description stands behind the colon; the extension puts both where the site
looks for them.
"""

import re

import griffe

SECTION = re.compile(
    r"^(?:Parameters|Raises|Attributes)\n-+\n(?:.+\n?|\n(?!\w.*\n-))+", re.MULTILINE
)
ITEM = re.compile(r"^(\w[\w, ]*) : (.+)$", re.MULTILINE)


class Descriptions(griffe.Extension):
    """Move each description to a line of its own, and put the type of a field of a class behind
    the colon.
    """

    def on_object(self, *, obj: griffe.Object, **_: object) -> None:
        """Rewrite the docstring of a function, a class or a module."""

        def item(found: re.Match[str]) -> str:
            field = obj.members.get(found[1]) if obj.is_class else None
            kind = f" : {field.annotation}" if isinstance(field, griffe.Attribute) else ""
            return f"{found[1]}{kind}\n    {found[2]}"

        if obj.docstring:
            obj.docstring.value = SECTION.sub(
                lambda section: ITEM.sub(item, section[0]), obj.docstring.value
            )
