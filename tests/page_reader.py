"""What a page consists of, as a parser of HTML sees it."""

import json
import re
from html.parser import HTMLParser

from winchcascade.report.render.page import template_folder

VOID = {"meta", "link", "br", "img", "input", "hr", "col", "wbr"}
NAMESPACES = {"http://www.w3.org/2000/svg", "http://www.w3.org/1999/xlink"}
FORBIDDEN = {"img", "iframe", "object", "embed", "base", "audio", "video", "form"}
"""Elements that could ask for something outside a page."""


class PageReader(HTMLParser):
    """Elements and texts of a page; `faults` of its structure."""

    def __init__(self, text: str) -> None:
        super().__init__(convert_charrefs=True)
        self.open: list[str] = []
        self.faults: list[str] = []
        self.elements: list[tuple[str, dict[str, str]]] = []
        self.texts: list[tuple[str, str]] = []
        self.feed(text)
        self.close()
        self.faults += [f"{tag} is never closed" for tag in self.open]

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.handle_startendtag(tag, attrs)
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        if len({name for name, _ in attrs}) < len(attrs):
            self.faults.append(f"an attribute twice in {tag} {attrs}")
        self.elements.append((tag, {name: value or "" for name, value in attrs}))

    def handle_endtag(self, tag: str) -> None:
        if not self.open or self.open.pop() != tag:
            self.faults.append(f"</{tag}> closes something else, line {self.getpos()[0]}")

    def handle_data(self, data: str) -> None:
        self.texts.append((self.open[-1] if self.open else "", data))

    @property
    def shown(self) -> str:
        """Every text that a reader sees."""
        return "".join(text for tag, text in self.texts if tag not in ("script", "style"))

    def values(self, attribute: str) -> list[str]:
        """Values of an attribute wherever it is."""
        return [attributes[attribute] for _, attributes in self.elements if attribute in attributes]

    @property
    def links(self) -> set[str]:
        """Addresses of other files."""
        return {value for value in self.values("href") if not value.startswith(("#", "data:"))}

    def foreign_scripts(self) -> list[str]:
        """Scripts that are neither those of the templates nor JSON that no text can end."""
        own = [
            (template_folder() / name).read_text(encoding="utf-8")
            for name in ("uplot.js", "page.js")
        ]
        found = [text for tag, text in self.texts if tag == "script"]
        data = [
            text for text in found if text.startswith("{") and "<" not in text and json.loads(text)
        ]
        return [text for text in found if text not in own and text not in data]

    def dangling(self) -> set[str]:
        """Targets within the page that do not exist."""
        links = [
            v for name in ("href", "xlink:href") for v in self.values(name) if v.startswith("#")
        ]
        named = [
            word
            for name in ("aria-labelledby", "for")
            for v in self.values(name)
            for word in v.split()
        ]
        painted = re.findall(
            r"url\(#([^)]*)\)", " ".join(v for _, a in self.elements for v in a.values())
        )
        return ({link[1:] for link in links} | set(named) | set(painted)) - set(self.values("id"))

    def requests(self) -> list[str]:
        """What would make a browser ask for something else, or run what is no script of the
        page.
        """
        found = [tag for tag, _ in self.elements if tag in FORBIDDEN]
        found += [*self.values("src"), *self.values("srcset")]
        found += [name for _, a in self.elements for name in a if name.startswith("on")]
        addresses = {
            v
            for _, a in self.elements
            for v in a.values()
            if re.match(r"\s*(\w+://|javascript:)", v)
        }
        found += sorted(addresses - NAMESPACES)
        for tag, text in self.texts:
            if tag == "style":
                found += re.findall(r"@import|url\(|https?:", text)
            elif tag == "script" and not text.startswith("{"):
                code = re.sub(
                    r"/\*.*?\*/", "", text, flags=re.DOTALL
                )  # without the licence of what it holds
                found += sorted(set(re.findall(r'https?://[^"]*', code)) - NAMESPACES)
                calls = r"\b(?:fetch|XMLHttpRequest|import|eval|sendBeacon|WebSocket|innerHTML)\b\s*[(.=]"
                found += re.findall(calls, code)
        return found
