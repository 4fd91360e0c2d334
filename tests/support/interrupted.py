"""An executor that is interrupted, as by Ctrl-C."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Executor, Future
from typing import Any


class Interrupted(Executor):
    """Does so many parts, then is interrupted as by Ctrl-C."""

    def __init__(self, parts: int) -> None:
        self._left = parts

    def submit(self, function: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        future: Future[Any] = Future()
        if self._left == 0:
            raise KeyboardInterrupt
        self._left -= 1
        future.set_result(function(*args, **kwargs))
        return future
