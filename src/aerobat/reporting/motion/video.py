"""Videos of plans and flights: MP4 for players, GIF for pages that show only images."""

from __future__ import annotations

import os
import subprocess
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path
from tempfile import TemporaryFile

import numpy as np
from numpy.typing import NDArray

from aerobat.declaration import PathName, Positive, validated
from aerobat.errors import SpecError, import_extra
from aerobat.evaluation.subject import subject_of
from aerobat.planning import Plan
from aerobat.reporting.motion.picture import MovingPicture
from aerobat.simulation import Flight
from aerobat.storage import whole_file
from aerobat.vehicle import Vehicle

FPS = 30
HOLD = 0.6  # [s] that the last picture stays
DPI = {".mp4": 160, ".gif": 100}  # 1152 and 720 pixels across
GIF_COLOURS = "split[a][b];[a]palettegen=max_colors=64:stats_mode=diff[p];[b][p]paletteuse=dither=none"
ENCODING = {
    ".mp4": ["-c:v", "libx264", "-pix_fmt", "yuv420p", "-crf", "20", "-movflags", "+faststart"],
    ".gif": ["-c:v", "gif", "-pix_fmt", "pal8", "-filter_complex", GIF_COLOURS],
}


@validated
def write_video(
    shown: Flight | Plan,
    path: PathName,
    plan: Plan | None = None,
    vehicle: Vehicle | str | None = None,
    speed: Positive = 0.5,
    progress: Callable[[int, int], None] | None = None,
) -> None:
    """Write a video of a flight, a batch or a plan, 30 frames a second, whole or not at all.

    Raises SpecError for a file that is neither .mp4 nor .gif, where there is nothing to show, and where the
    file cannot be written; BackendMissing without imageio-ffmpeg.

    Args:
        shown: What is shown.
        path: The file to write.
        plan: What was flown, for its gates and stages.
        vehicle: What flew, or its name; by default the plan's, or the preset of the flight's name.
        speed: The speed of time in the video, 1 as it was flown [-].
        progress: Called after each frame with the number of frames drawn, and of all frames.
    """
    suffix = Path(path).suffix.lower()
    if suffix not in ENCODING:
        raise SpecError(f"video: {path} is neither .mp4 nor .gif; name a file of one of them")
    extra = import_extra("imageio_ffmpeg", "a video needs imageio-ffmpeg", "aerobat[viewer]")
    if isinstance(shown, Flight) and (not shown.vehicles or len(shown.times) < 2):
        raise SpecError("the flight holds nothing that moves; show one vehicle or more, of two rows or more")
    picture = MovingPicture(subject_of(shown, plan, vehicle), DPI[suffix])
    times = frame_times(picture.duration, speed)
    with whole_file(path) as temporary:
        _encode(extra.get_ffmpeg_exe(), picture.size, temporary, suffix, _frames(picture, times, progress))


def frame_times(duration: float, speed: float) -> NDArray[np.float64]:
    """Return the instants [s] of a video's frames; the last one is held. Raise SpecError for too many."""
    count = duration / speed * FPS
    if count > 20_000:  # eleven minutes
        raise SpecError(
            f"speed: {duration:g} s at {speed:g} times their speed are {count:.0f} frames; raise it"
        )
    times = np.arange(0.0, duration, speed / FPS)
    return np.concatenate([times, np.full(round(HOLD * FPS), duration)])


def _frames(
    picture: MovingPicture, times: NDArray[np.float64], progress: Callable[[int, int], None] | None
) -> Iterator[NDArray[np.uint8]]:
    for k, time in enumerate(times.tolist()):
        yield picture.at(time)
        if progress is not None:
            progress(k + 1, len(times))


def _encode(
    ffmpeg: str, size: tuple[int, int], file: Path, suffix: str, frames: Iterator[NDArray[np.uint8]]
) -> None:
    """Write a file of frames by FFmpeg. Raise OSError with FFmpeg's own message where it fails."""
    source = ["-f", "rawvideo", "-pix_fmt", "rgb24", "-s", f"{size[0]}x{size[1]}", "-r", str(FPS), "-i", "-"]
    command = [ffmpeg, "-y", "-v", "error", *source, *ENCODING[suffix], str(file)]
    group = 0 if os.name == "posix" else None  # of its own: Ctrl-C is ours
    with TemporaryFile() as said:
        with subprocess.Popen(command, stdin=subprocess.PIPE, stderr=said, process_group=group) as process:
            assert process.stdin is not None, "it is a pipe"
            for frame in frames:
                try:
                    process.stdin.write(frame.tobytes())
                except BrokenPipeError:  # it has ended; its status says so
                    break
            with suppress(BrokenPipeError):
                process.stdin.close()
        if process.returncode != 0:
            said.seek(0)
            lines = said.read().decode(errors="replace").splitlines()
            reason = lines[-1].rpartition("] ")[2] if lines else f"status {process.returncode}"
            raise OSError(f"FFmpeg failed: {reason}")
