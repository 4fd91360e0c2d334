"""The README's pictures, drawn anew by the commands that it tells of."""

import shutil
import sys
import tempfile
from pathlib import Path

from aerobat.cli import main

PICTURES = (
    (["fly", "flip-roll"], "report.png", "flip-roll.png"),
    (["compare", "section-v", "--vehicle", "section-v"], "compare.png", "compare-section-v.png"),
)

out = Path(sys.argv[1] if len(sys.argv) > 1 else "docs")
out.mkdir(parents=True, exist_ok=True)
for command, made, name in PICTURES:
    with tempfile.TemporaryDirectory() as folder:
        main([*command, "--out", folder])
        shutil.copyfile(Path(folder) / made, out / name)
