"""A finding of a check: something that is too fast for a period or a step, and the worst of several of one kind."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from typing import NamedTuple


class TooFast(NamedTuple):
    """Something that is too fast for a period or a step.

    Attributes:
        kind: the kind of finding; of several of one kind the worst is told.
        excess: its rate, or how many times it is beyond what is borne; the larger the worse among those of one kind.
        sentence: the sentence about it.
    """

    kind: str
    excess: float
    sentence: str


def select_worst(found: Iterable[TooFast]) -> Iterator[TooFast]:
    """Yield the worst finding of each kind."""
    every = list(found)
    for kind in dict.fromkeys(one.kind for one in every):
        yield max((one for one in every if one.kind == kind), key=lambda one: one.excess)


def gather_paths(found: Sequence[Sequence[TooFast]]) -> Iterator[str]:
    """Yield a sentence for each kind of findings on several paths, with their number and the worst one."""
    for worst in select_worst(one for each in found for one in each):
        of_paths = {
            path: max(one.excess for one in each if one.kind == worst.kind)
            for path, each in enumerate(found)
            if any(one.kind == worst.kind for one in each)
        }
        if len(found) == 1:
            yield worst.sentence
        elif len(of_paths) == 1:
            yield f"{worst.sentence}; so it is on path {min(of_paths)} of {len(found)}, counted from 0"
        else:
            path = max(of_paths, key=lambda path: of_paths[path])
            yield (
                f"{worst.sentence}; so it is on {len(of_paths)} of {len(found)} paths, the worst of which is path "
                f"{path}, counted from 0"
            )
