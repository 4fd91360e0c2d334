"""The folder of an unfinished study, beside the one that it is for: what is finished is kept there."""

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
    """A study's folder until it is written as a whole."""

    folder: Path

    @classmethod
    def beside(cls, folder: Path) -> Unfinished:
        """Return the unfinished study beside the folder that it is to be written to."""
        return cls(folder.with_name(f"{folder.name}-unfinished"))

    @property
    def parts(self) -> Path:
        """The folder of the finished parts."""
        return self.folder / "finished"

    @contextmanager
    def kept(self, what: str, count: int, finished: Callable[[Path], int]) -> Iterator[None]:
        """Say what is kept of a study that is ended in the block; remove the folder where that is nothing.

        Args:
            what: The parts are called.
            count: Of all parts.
            finished: Counts those in a folder.
        """
        try:
            yield
        except BaseException as error:
            done = finished(self.parts)
            if not done:
                self.remove()
            elif isinstance(error, KeyboardInterrupt | WorkerEnded):
                say(f"{done} of {count} {what} are kept: the same command goes on from there")
            raise

    def remove(self) -> None:
        """Remove what the study needs no longer."""
        shutil.rmtree(self.folder, ignore_errors=True)
