"""Files and folders that are whole or absent: made under a temporary name, then renamed; arrays read back."""

from __future__ import annotations

import ctypes
import hashlib
import io
import os
import re
import shutil
import stat
import zipfile
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from aerobat.errors import SpecError


class CannotWrite(SpecError):
    """A place cannot be written: the message names it as it was given, and the system's reason."""

    def __init__(self, path: str | os.PathLike[str], reason: OSError) -> None:
        super().__init__(f"cannot write {path}: {reason.strerror or reason}")
        self.reason = reason


@contextmanager
def whole_file(path: str | os.PathLike[str]) -> Iterator[Path]:
    """A temporary path beside `path`, renamed to it when the block ends well, removed when it does not.

    A file that is replaced keeps its mode, and a link to it stays. What killed processes have left in that
    folder is removed. Missing parent folders are made. Raises CannotWrite when the place cannot be written.
    """
    try:
        target = Path(os.path.realpath(path))
        if target.exists() and not (target.is_file() or target.is_dir()):
            raise OSError("it is a pipe or a device, not a file")
        target.parent.mkdir(parents=True, exist_ok=True)
        _remove_abandoned(target.parent)
        mark = f"{os.urandom(4).hex()}.{os.getpid()}{_STAGING}"
        temporary = target.with_name(f".{target.stem}.{mark}{target.suffix}")
        temporary.touch(exist_ok=False)
    except OSError as error:
        raise CannotWrite(path, error) from None
    try:
        yield temporary
        _sync(temporary)
        _keep_mode(temporary, target)
        temporary.replace(target)
    except OSError as error:
        raise CannotWrite(path, error) from None
    finally:
        temporary.unlink(missing_ok=True)


@contextmanager
def whole_folder(path: str | os.PathLike[str], is_ours: Callable[[str], bool]) -> Iterator[Path]:
    """Yield an empty folder that takes the place of `path`, as one, when the block ends well.

    Whatever ends it, at `path` is either what was there before or all of the new, never a mixture, and no
    parent is left that was made for nothing. What is replaced keeps its mode, and a link to the folder stays.
    What killed processes have left in its parent is removed. The current folder itself stays, since whoever
    is in it would see nothing of the new one: its files are replaced one by one.

    Raises CannotWrite when the place cannot be written, and SpecError for a folder that holds anything whose
    name is not ours: that is somebody's work.

    Args:
        path: The folder to make or to replace; missing parents are made.
        is_ours: Whether a file of this name may be replaced.
    """
    try:
        target = Path(os.path.realpath(path))
        require_replaceable(path, is_ours)
        made = [parent for parent in target.parents if not parent.exists()]
        target.parent.mkdir(parents=True, exist_ok=True)
        stays = target.exists() and target.samefile(".")
        beside = target if stays else target.parent
        _remove_abandoned(beside)
        staging = beside / f".{target.name}.{os.getpid()}{_STAGING}"
        shutil.rmtree(staging, ignore_errors=True)
        staging.mkdir()
    except OSError as error:
        raise CannotWrite(path, error) from None
    try:
        yield staging
        for written in (*staging.iterdir(), staging):
            _sync(written)
            _keep_mode(written, target / written.relative_to(staging))
        if stays:
            _move_into(target, staging, is_ours)
        elif target.exists():
            _exchange(staging, target)
        else:
            staging.rename(target)
    except CannotWrite as error:  # of a file in it
        raise CannotWrite(path, error.reason) from None
    except OSError as error:
        raise CannotWrite(path, error) from None
    finally:
        shutil.rmtree(staging, ignore_errors=True)
        if not target.exists():
            with suppress(OSError):  # somebody else's by now
                for parent in made:
                    parent.rmdir()


def require_replaceable(path: str | os.PathLike[str], is_ours: Callable[[str], bool]) -> None:
    """Refuse a folder that holds anything whose name is not ours: that is somebody's work. Raises SpecError.

    What killed processes have left in it is removed.
    """
    try:
        target = Path(os.path.realpath(path))
        _remove_abandoned(target)  # of files that were being written into it
        foreign = sorted(name for name in _entries(target) if not is_ours(name))
    except OSError as error:
        raise CannotWrite(path, error) from None
    if foreign:
        raise SpecError(f"{path}/ holds {foreign[0]}, which no run wrote; give a folder of its own")


def write_whole(path: str | os.PathLike[str], content: str | bytes) -> None:
    """Write a file's whole content, or nothing. Raises CannotWrite when the place cannot be written."""
    with whole_file(path) as temporary:
        temporary.write_bytes(content.encode() if isinstance(content, str) else content)


def read_whole(path: str | os.PathLike[str], max_size: int) -> bytes:
    """Return a file's whole content.

    Raises SpecError, one sentence without the file's name, where it cannot be read, and for what is no file
    of at most `max_size` bytes: a pipe or a device may never end.
    """
    try:
        with open(path, "rb", opener=_open_at_once) as file:
            found = os.fstat(file.fileno())
            if not stat.S_ISREG(found.st_mode):
                raise SpecError("it is a pipe or a device, not a file; give a file's path")
            if found.st_size > max_size:
                raise SpecError(f"it has {found.st_size / 2**20:.0f} MiB, more than {max_size // 2**20} MiB")
            return file.read()
    except FileNotFoundError:
        raise SpecError("there is no such file; check the path") from None
    except IsADirectoryError:
        raise SpecError("this is a folder; give the path of a file") from None
    except SpecError:
        raise
    except (OSError, ValueError) as error:
        raise SpecError(f"cannot be read: {getattr(error, 'strerror', None) or error}") from None


def read_arrays(
    path: str | os.PathLike[str], what: str, max_size: int | None = None
) -> dict[str, NDArray[Any]]:
    """The arrays of an .npz file that holds a `what`.

    Raises SpecError, one sentence, for any other file; before it is unpacked, where that would take much more
    memory than the file has bytes.

    Args:
        path: The file.
        what: What it should hold, in a word.
        max_size: Bytes, packed or not, by default MAX_ARRAYS.
    """
    limit = max_size or MAX_ARRAYS
    try:
        content = read_whole(path, limit)
        arrays = _unpacked(content, min(limit, SMALL_ARRAYS + MAX_EXPANSION * len(content)))
        if arrays is None:
            raise SpecError(f"it is not a whole .npz file of a {what}; save it again")
        return arrays
    except SpecError as error:
        raise SpecError(f"{what} file {path}: {error}") from None


def digest_of(content: Mapping[str, NDArray[Any]]) -> str:
    """Return the SHA-256 of all arrays but a `digest`, in the order of their names."""
    found = hashlib.sha256()
    for name in sorted(content.keys() - {"digest"}):
        found.update(name.encode() + np.ascontiguousarray(content[name]).tobytes())
    return found.hexdigest()


def format_of(content: Mapping[str, NDArray[Any]]) -> str:
    """The format that an .npz file says it has, in a few words."""
    named = content.get("format")
    if named is None or named.shape or named.dtype.kind != "U" or not str(named).isprintable():
        return "something else"
    return str(named)[:40]


MAX_ARRAYS = 2**27  # bytes of an .npz file, packed or not: a path of an hour at 100 rows a second
SMALL_ARRAYS = 2**26  # bytes that any file may unpack to; beyond,
MAX_EXPANSION = 10  # times its size: numbers hardly shrink
MAX_ENTRIES = 5000  # of an archive: ten for each of 500 gates
_STAGING = ".aerobat-part"
_ABANDONED = re.compile(r"\..*\.(\d{1,9})" + re.escape(_STAGING) + ".*")  # its process
_AT_FDCWD, _RENAME_SWAP = -100, 2  # of renameat2(2) and renamex_np(2)


def _unpacked(content: bytes, max_size: int) -> dict[str, NDArray[Any]] | None:
    """The arrays of an archive; None for a damaged one, and for one that unpacks to more bytes."""
    try:
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            sizes = [entry.file_size for entry in archive.infolist()]
        if len(sizes) <= MAX_ENTRIES and sum(sizes) <= max_size:
            with np.load(io.BytesIO(content), allow_pickle=False) as file:
                return dict(file)
    except Exception:  # zlib, lzma, struct, tokenize, memory: a damaged archive can end in anything
        pass
    return None


def _open_at_once(path: str, flags: int) -> int:
    """Open a file without waiting for what a pipe will hold."""
    return os.open(path, flags | getattr(os, "O_NONBLOCK", 0))


def _entries(folder: Path) -> list[str]:
    try:
        return os.listdir(folder)
    except FileNotFoundError:
        return []


def _move_into(target: Path, staging: Path, is_ours: Callable[[str], bool]) -> None:
    """Move the files of a folder in a target to the target, then remove others of ours there."""
    made = _entries(staging)
    for name in made:
        (staging / name).replace(target / name)
    for name in filter(is_ours, set(_entries(target)) - {*made}):
        _remove(target / name)


def _exchange(a: Path, b: Path) -> None:
    """Let two folders change places: at once where the system can, else in two steps."""
    names = os.fsencode(a), os.fsencode(b)
    libc: Any = ctypes.CDLL(None) if os.name == "posix" else None
    if hasattr(libc, "renameat2"):  # Linux
        swapped = libc.renameat2(_AT_FDCWD, names[0], _AT_FDCWD, names[1], _RENAME_SWAP) == 0
    else:
        swapped = hasattr(libc, "renamex_np") and libc.renamex_np(*names, _RENAME_SWAP) == 0  # macOS
    if swapped:
        return
    aside = a.with_name(a.name + "-old")
    b.rename(aside)
    a.rename(b)
    aside.rename(a)


def _keep_mode(made: Path, replaced: Path) -> None:
    """Give what was made the mode of what it takes the place of, where there is such."""
    with suppress(FileNotFoundError):
        made.chmod(stat.S_IMODE(replaced.stat().st_mode))


def _sync(path: Path) -> None:
    """Have the disk hold a file, or a folder's entries where the system can, before it is renamed."""
    is_folder = path.is_dir()
    try:
        descriptor = os.open(path, os.O_RDONLY if is_folder else os.O_RDWR)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)
    except OSError:
        if not is_folder:
            raise


def _remove_abandoned(folder: Path) -> None:
    """Remove what processes that no longer run have left in a folder: .NAME.PROCESS followed by our mark."""
    if os.name != "posix":  # elsewhere asking for a process may end it
        return
    for left in folder.glob(f".*{_STAGING}*"):
        named = _ABANDONED.fullmatch(left.name)
        with suppress(PermissionError):
            try:
                if named is not None:
                    os.kill(int(named[1]), 0)
            except ProcessLookupError:
                _remove(left)


def _remove(path: Path) -> None:
    if path.is_dir():
        shutil.rmtree(path, ignore_errors=True)
    else:
        path.unlink(missing_ok=True)
