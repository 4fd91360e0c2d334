"""What a command runs: its own code in its own process, and nothing that lies in the working folder."""

import shutil
import subprocess
import sys
import sysconfig
from pathlib import Path

import pytest

HOSTILE = (*sys.stdlib_module_names, "sitecustomize", "numpy", "matplotlib", "PIL", "llvmlite", "aerobat")
WATCHED = """
import sys, matplotlib.font_manager  # at its first use ever, matplotlib asks the system for its fonts
started = []
BIRTHS = ("subprocess.Popen", "os.system", "os.fork", "os.forkpty", "os.exec", "os.spawn", "os.posix_spawn")
sys.addaudithook(lambda event, _: started.append(event) if event in BIRTHS else None)
from aerobat.cli import main
main(["fly", "line", "--json"])
assert not started, started
"""


pytestmark = pytest.mark.process


def test_no_code_of_the_working_folder_runs(tmp_path: Path) -> None:
    marker = tmp_path / "run"
    for name in HOSTILE:
        code = f"open({str(marker)!r}, 'a').write({name!r})\nraise SystemExit(1)\n"
        (tmp_path / f"{name}.py").write_text(code)
    command = shutil.which("aerobat", path=sysconfig.get_path("scripts"))
    assert command is not None
    ended = subprocess.run([command, "fly", "line"], cwd=tmp_path, capture_output=True, text=True)
    assert not marker.exists(), marker.read_text()
    assert (ended.returncode, ended.stderr) == (0, "")
    assert (tmp_path / "out" / "line" / "report.png").read_bytes().startswith(b"\x89PNG")


def test_a_command_starts_no_other_process(tmp_path: Path) -> None:
    subprocess.run([sys.executable, "-c", WATCHED], cwd=tmp_path, check=True, capture_output=True)
