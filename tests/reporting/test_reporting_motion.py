"""Videos: as long as they should be, of what was flown, whole or not there."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import imageio_ffmpeg
import numpy as np
import pytest

import aerobat as ab
from aerobat import cli
from aerobat.evaluation.subject import subject_of
from aerobat.reporting.motion.picture import MovingPicture
from aerobat.reporting.motion.video import FPS, HOLD, frame_times
from reporting_cases import simulated
from shared_plans import shared_plan

RATES = {"gif": 100 / 3, "mp4": FPS}  # a GIF counts in hundredths of a second


@pytest.mark.parametrize("suffix", ["gif", pytest.param("mp4", marks=pytest.mark.slow)])
def test_a_video_lasts_as_long_as_the_flight_at_its_speed_and_shows_it(tmp_path: Path, suffix: str) -> None:
    told: list[tuple[int, int]] = []
    flight, plan = simulated("half-flip"), shared_plan("half-flip")
    file = tmp_path / f"half.{suffix}"
    ab.write_video(flight, file, plan, speed=3.0, progress=lambda *counts: told.append(counts))
    frames, seconds = imageio_ffmpeg.count_frames_and_secs(str(file))
    expected = len(frame_times(float(flight.times[-1]), 3.0))
    assert frames == pytest.approx(expected, abs=1)
    assert seconds == pytest.approx(expected / RATES[suffix], rel=0.12)
    assert told == [(k + 1, expected) for k in range(expected)]
    assert [path.name for path in tmp_path.iterdir()] == [file.name]


def test_frames_are_evenly_spaced_and_the_last_one_stays() -> None:
    times = frame_times(2.0, 0.5)
    held = round(HOLD * FPS)
    np.testing.assert_allclose(np.diff(times[:-held]), 0.5 / FPS)
    assert (times[-held:] == 2.0).all()
    with pytest.raises(ab.SpecError, match=r"speed: 3600 s at 0\.1 times their speed are 1080000 frames"):
        frame_times(3600.0, 0.1)


def test_a_picture_depends_on_its_instant_alone() -> None:
    """Nothing of the pictures before it is left in one, and what stands still stands still."""
    subject = subject_of(simulated("flip-roll"), shared_plan("flip-roll"), None)
    picture = MovingPicture(subject, dpi=60)
    first, middle, again = (picture.at(t) for t in (0.3, 1.0, 0.3))
    assert first.shape == (picture.size[1], picture.size[0], 3)
    np.testing.assert_array_equal(first, again)
    changed = (first != middle).any(axis=-1)
    assert 0.001 < changed.mean() < 0.1


@pytest.mark.parametrize("kind", ["a plan", "a batch"])
def test_plans_and_batches_move_too(kind: str) -> None:
    plan = shared_plan("half-flip")
    shown = plan if kind == "a plan" else ab.fly(plan, ["agile-quad"] * 3, rate=200.0)
    picture = MovingPicture(subject_of(shown, plan, None), dpi=60)
    assert (picture.at(0.2) != picture.at(0.8)).any()


def test_what_cannot_be_a_video_is_refused_and_nothing_is_written(tmp_path: Path, monkeypatch) -> None:
    plan = shared_plan("line")
    with pytest.raises(ab.SpecError, match=r"neither \.mp4 nor \.gif"):
        ab.write_video(plan, tmp_path / "video.avi")
    with pytest.raises(ab.SpecError, match="vehicle is missing"):
        ab.write_video(replace(plan, vehicle=None), tmp_path / "video.gif")
    monkeypatch.setitem(sys.modules, "imageio_ffmpeg", None)
    with pytest.raises(ab.BackendMissing, match=r'pip install "aerobat\[viewer\]"'):
        ab.write_video(plan, tmp_path / "video.gif")
    assert not list(tmp_path.iterdir())


@pytest.mark.skipif(os.name != "posix", reason="the system limits no file's size")
@pytest.mark.process
@pytest.mark.parametrize("suffix", ["gif", "mp4"])
def test_a_video_that_does_not_fit_on_the_disk_is_refused_and_leaves_nothing(
    tmp_path: Path, suffix: str
) -> None:
    """The processes may write 8 kB a file, FFmpeg's among them."""
    shared_plan("line").save(tmp_path / "line.plan")
    (tmp_path / f"video.{suffix}").write_text("before")
    code = "import resource as r, sys; r.setrlimit(r.RLIMIT_FSIZE, (8192, 8192)); import aerobat.cli as cli; "
    command = f"cli.main(['view', 'line.plan', '--video', 'video.{suffix}', '--speed', '20'])"
    ended = subprocess.run(
        [sys.executable, "-B", "-c", code + command], cwd=tmp_path, capture_output=True, text=True
    )
    assert (ended.returncode, ended.stdout) == (2, "")
    assert re.fullmatch(rf"aerobat: cannot write video\.{suffix}: FFmpeg failed: .+\n", ended.stderr)
    assert (tmp_path / f"video.{suffix}").read_text() == "before"
    assert {path.name for path in tmp_path.iterdir()} == {"line.plan", f"video.{suffix}"}


@pytest.mark.slow
def test_the_command_writes_a_video_and_a_page_where_both_are_named(tmp_path: Path, capsys) -> None:
    shared_plan("line").save(tmp_path / "line.plan")
    video, page = tmp_path / "line.gif", tmp_path / "page.html"
    command = ["view", str(tmp_path / "line.plan"), "--video", str(video), "--speed", "20"]
    cli.main(command)
    assert not list(tmp_path.glob("*.html"))
    assert capsys.readouterr().out.endswith(f"written to {video}\n")
    page.write_text("mine")
    video.unlink()
    with pytest.raises(SystemExit):
        cli.main([*command, "--html", str(page)])
    assert not video.exists(), "refused before anything is drawn"
    page.unlink()
    cli.main([*command, "--html", str(page)])
    assert video.exists()
    assert page.exists()
