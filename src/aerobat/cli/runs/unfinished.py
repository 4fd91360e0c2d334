"""The folder that keeps the finished parts of an unfinished study, beside the folder of its results."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from aerobat.cli.terminal import say
from aerobat.studies.workers import WorkerEnded


@dataclass(frozen=True)
class Unfinished:
    """The folder that an unfinished study keeps beside the one that its results will be written to."""

    folder: Path

    @classmethod
    def beside(cls, folder: Path) -> Unfinished:
        """Return the unfinished study whose results will be written to a folder."""
        return cls(folder.with_name(f"{folder.name}-unfinished"))

    @property
    def parts(self) -> Path:
        """The folder of the finished parts."""
        return self.folder / "finished"

    @contextmanager
    def kept(self, what: str, count: int, finished: Callable[[Path], int]) -> Iterator[None]:
        """Remove the folder after the block; if that ends early, report the kept parts, if there are any.

        Args:
            what: The name of the parts.
            count: The number of all parts.
            finished: Returns the number of parts in a folder.
        """
        try:
            yield
        except BaseException as error:
            done = finished(self.parts)
            if not done:
                self._remove()
            elif isinstance(error, KeyboardInterrupt | WorkerEnded):
                say(f"{done} of {count} {what} are kept: the same command goes on from there")
            raise
        self._remove()

    def _remove(self) -> None:
        shutil.rmtree(self.folder, ignore_errors=True)
