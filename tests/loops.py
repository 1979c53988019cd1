"""Many cases in one test: a loop that reports every case that fails, and a choice of cases in
place of all combinations.
"""

from collections.abc import Callable, Iterable, Sequence
from itertools import combinations, product
from typing import Any

import pytest

Case = tuple[Any, ...]


def failures(check: Callable[..., object], cases: Iterable[Case]) -> list[str]:
    """Cases for which a check fails, each with the first line of the reason; a test asserts that
    there are none.

    >>> def is_even(number: int) -> None:
    ...     assert number % 2 == 0, "odd"
    >>> failures(is_even, [(1,), (2,), (3,)])
    ['(1,): odd', '(3,): odd']
    """
    found, tried = [], 0
    for case in cases:
        tried += 1
        try:
            check(*case)
        except (Exception, pytest.fail.Exception) as fault:
            reason = str(fault).split("\n", 1)[0] or type(fault).__name__
            found.append(f"{case}: {reason}")
    assert tried > 0, "no case was tried"
    return found


def rejections(read: Callable[[str, str], object], fault: type[Exception], cases: str) -> list[str]:
    """Check files that cannot be used: lines of a text, with ; for a line end, an @ and the words
    that the sentence contains.

    The sentence begins with the name of the file; what fails is returned.
    """

    def check(text: str, words: str) -> None:
        with pytest.raises(fault) as found:
            read(text, "mine.toml")
        sentence = str(found.value)
        assert sentence.startswith("mine.toml: "), sentence
        assert sentence.isprintable()
        assert [word for word in words.split() if word not in sentence] == [], sentence

    parts = (line.rpartition(" @ ") for line in cases.strip().splitlines())
    return failures(check, [(text.replace(";", "\n"), words) for text, _, words in parts])


def all_pairs(*choices: Iterable[Any]) -> list[Case]:
    """Few combinations that hold every pair of values of any two choices; the same ones at every
    call.

    >>> all_pairs("ab", [1, 2], "xy")
    [('a', 1, 'x'), ('a', 2, 'y'), ('b', 1, 'y'), ('b', 2, 'x')]
    """
    values = [list(choice) for choice in choices]
    every = list(product(*(range(len(choice)) for choice in values)))
    open_pairs = {pair for indices in every for pair in _pairs(indices)}
    chosen = []
    while open_pairs:
        best = max(every, key=lambda indices: len(open_pairs.intersection(_pairs(indices))))
        open_pairs.difference_update(_pairs(best))
        chosen.append(best)
    return [
        tuple(choice[k] for choice, k in zip(values, indices, strict=True))
        for indices in sorted(chosen)
    ]


def _pairs(indices: Sequence[int]) -> list[tuple[tuple[int, int], tuple[int, int]]]:
    return list(combinations(enumerate(indices), 2))
