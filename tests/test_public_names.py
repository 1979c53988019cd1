"""Every public name: it is listed, documented, and its signature resolves."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterator
from typing import Any

import pytest

import winchcascade
from winchcascade.diagnosis.diagnosis_result import DiagnosisResult

CLASSES = {
    name: one
    for name in winchcascade.__all__
    if inspect.isclass(one := getattr(winchcascade, name))
}


def public_calls() -> Iterator[tuple[str, Callable[..., Any]]]:
    """Public functions and classes, the methods and properties of these, and those of a
    diagnosis, which a campaign returns.
    """
    for name in winchcascade.__all__:
        if callable(found := getattr(winchcascade, name)):
            yield name, found
    for name, kind in (CLASSES | {"DiagnosisResult": DiagnosisResult}).items():
        for member, part in inspect.getmembers(kind):
            call = part.fget if isinstance(part, property) else part
            if not member.startswith("_") and (inspect.isfunction(call) or inspect.ismethod(call)):
                yield f"{name}.{member}", call


CALLS = [*public_calls()]


@pytest.mark.parametrize(("name", "call"), CALLS, ids=[name for name, _ in CALLS])
def test_the_signature_of_every_public_name_resolves(name: str, call: Callable[..., Any]) -> None:
    signature = inspect.signature(call, eval_str=True)
    parts = [*(p.annotation for p in signature.parameters.values()), signature.return_annotation]
    assert not any(isinstance(part, str) for part in parts), name


@pytest.mark.parametrize("name", winchcascade.__all__)
def test_every_public_name_is_listed_and_documented(name: str) -> None:
    found = getattr(winchcascade, name)
    assert name in dir(winchcascade)
    assert isinstance(found, str) or inspect.getdoc(found)


def test_only_public_names_are_listed() -> None:
    assert dir(winchcascade) == sorted(winchcascade.__all__)
