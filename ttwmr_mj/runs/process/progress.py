"""A progress bar with time left, on terminals only."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager


@contextmanager
def progress_bar(
    name: str, total: float | None, unit: str, quiet: bool = False
) -> Iterator[Callable[[float], None] | None]:
    """Show progress on stderr while the context lasts; yields a function of the amount done.

    A total of None is for work without a known end.
    """
    if quiet:
        yield None
        return
    from tqdm import tqdm

    # disable=None: silent where stderr is no terminal
    shape = _FORMAT if total is not None else None
    with tqdm(total=total, desc=name, unit=unit, disable=None, bar_format=shape) as bar:

        def done(amount: float) -> None:
            bar.update(amount - bar.n)

        yield done


_FORMAT = "{desc} {percentage:3.0f}% |{bar:30}| {n:.0f}/{total:.0f} {unit}, {remaining} left"
