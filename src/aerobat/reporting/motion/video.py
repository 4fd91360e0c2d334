"""Videos of plans and flights: MP4 for players, GIF for pages that take no other."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from aerobat.declaration import PathName, Positive, validated
from aerobat.errors import BackendMissing, SpecError
from aerobat.planning import Plan
from aerobat.reporting.motion.picture import MovingPicture, subject_of
from aerobat.simulation import Flight
from aerobat.storage import whole_file
from aerobat.vehicle import Vehicle

FPS = 30
HOLD = 0.6  # [s] that the last picture stays
MAX_FRAMES = 20_000  # eleven minutes
DPI = {".mp4": 160, ".gif": 100}  # 1152 and 720 pixels across
GIF_COLOURS = "split[a][b];[a]palettegen=max_colors=64:stats_mode=diff[p];[b][p]paletteuse=dither=none"
ENCODING: dict[str, dict[str, Any]] = {
    ".mp4": {"codec": "libx264", "output_params": ["-crf", "20", "-movflags", "+faststart"]},
    ".gif": {"codec": "gif", "pix_fmt_out": "pal8", "output_params": ["-filter_complex", GIF_COLOURS]},
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
        shown: What is looked at.
        path: Of the file.
        plan: What was flown, for its gates and stages.
        vehicle: What flew, or its name; by default the plan's, or the preset of the flight's name.
        speed: Of time in the video, 1 as it was flown [-].
        progress: Told after each frame how many are drawn, and of how many.
    """
    suffix = Path(path).suffix.lower()
    if suffix not in ENCODING:
        raise SpecError(f"video: {path} is neither .mp4 nor .gif; name a file of one of them")
    encoder = _encoder()
    subject = subject_of(shown, plan, vehicle)
    times = frame_times(subject.duration, speed)
    picture = MovingPicture(subject, DPI[suffix])
    with whole_file(path) as temporary:
        _encode(encoder, picture.size, temporary, suffix, _frames(picture, times, progress))
        _require_whole(encoder, temporary, len(times))


def frame_times(duration: float, speed: float) -> NDArray[np.float64]:
    """The instants [s] of a video's frames; the last one stays. Raises SpecError where they are too many."""
    count = duration / speed * FPS
    if count > MAX_FRAMES:
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
    encoder: Any, size: tuple[int, int], file: Path, suffix: str, frames: Iterator[NDArray[np.uint8]]
) -> None:
    """Have FFmpeg make a file of frames."""
    writer = encoder.write_frames(
        str(file),
        size,
        fps=FPS,
        quality=None,
        macro_block_size=1,
        ffmpeg_log_level="quiet",  # what was not written is told afterwards
        **ENCODING[suffix],
    )
    writer.send(None)
    try:
        for frame in frames:
            writer.send(np.ascontiguousarray(frame))
    except OSError:  # of a pipe to a program that has ended; `_require_whole` says so
        pass
    finally:
        writer.close()


def _require_whole(encoder: Any, file: Path, frames: int) -> None:
    """Refuse a file with fewer frames. Raises OSError: FFmpeg ends in many ways, and none is an exception."""
    try:
        found = encoder.count_frames_and_secs(str(file))[0]
    except RuntimeError:  # no video at all
        found = 0
    if found < frames - 1:  # a GIF counts time in hundredths of a second, and may have one less
        raise OSError(f"FFmpeg wrote {found} of {frames} frames; see if the disk is full")


def _encoder() -> Any:
    try:
        import imageio_ffmpeg
    except ImportError:
        remedy = 'pip install "aerobat[viewer]"'
        raise BackendMissing(f"a video needs imageio-ffmpeg; install it with {remedy}") from None
    return imageio_ffmpeg
