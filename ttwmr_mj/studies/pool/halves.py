"""Chunks of work of which any may break: what breaks is halved until the piece is found."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Generator, Iterable, Iterator
from contextlib import closing
from typing import Protocol, Self, TypeVar


class Chunk(Protocol):
    """Several pieces of work, such as an array or a tuple of them."""

    def __len__(self) -> int: ...

    def __getitem__(self, part: slice, /) -> Self: ...


C = TypeVar("C", bound=Chunk)
E = TypeVar("E")


def in_halves(
    chunks: Iterable[C],
    compute: Callable[[Iterable[C]], Generator[tuple[C, E], None, None]],
    broke: Callable[[E], bool],
) -> Generator[tuple[C, E], None, None]:
    """Compute chunks; one that breaks is cut in two, down to single pieces.

    Args:
        chunks: in the order in which they are started.
        compute: computes chunks in any order, and says of each what came of it; it takes one from
            the iterable only when there is room for it.
        broke: whether what came of a chunk is not to be kept while it can be halved.

    Yields:
        Every chunk, or its parts, with what came of it.
    """
    halves: deque[C] = deque()
    waiting = iter(chunks)

    def remaining() -> Iterator[C]:
        while True:
            if halves:
                yield halves.popleft()
            elif (chunk := next(waiting, None)) is not None:
                yield chunk
            else:
                return

    more = True
    while more:  # a chunk may break when all others have been handed out
        with closing(compute(remaining())) as outcomes:
            for chunk, outcome in outcomes:
                if len(chunk) > 1 and broke(outcome):
                    middle = (len(chunk) + 1) // 2
                    halves.extend((chunk[:middle], chunk[middle:]))
                else:
                    yield chunk, outcome
        more = bool(halves)
