# SPDX-License-Identifier: Apache-2.0
"""Progress of a run: tqdm's bar, or a function of the caller."""
from __future__ import annotations

import contextlib
import importlib
from typing import Any, Callable, Iterator, Union

from ._errors import UsageError

#: True: tqdm's bar where tqdm is installed; a function is called with the share done, 0 to 1, and the stage.
Progress = Union[bool, Callable[[float, str], object]]


@contextlib.contextmanager
def progress_function(progress: Progress) -> Iterator[Callable[[float, str], object] | None]:
    """What the native module calls, and nothing for False."""
    if callable(progress):
        yield progress
        return
    if not isinstance(progress, bool):
        raise UsageError(f"progress cannot be {progress!r}: give True, False or a function of the share and the stage")
    bar = _bar() if progress else None
    if bar is None:
        yield None
        return
    with bar:

        def show(share: float, stage: str) -> None:
            bar.set_description(stage, refresh=False)
            bar.update(max(0.0, share - bar.n))

        yield show


def _bar() -> Any:
    try:
        tqdm = importlib.import_module("tqdm.auto").tqdm
    except ImportError:
        return None
    return tqdm(total=1.0, leave=False, bar_format="{desc:<12} {percentage:3.0f} %|{bar}| {elapsed}")
