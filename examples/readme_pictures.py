"""The README's pictures, drawn anew by the commands that it tells of."""

import shutil
import sys
import tempfile
from pathlib import Path

from aerobat.cli import main

PICTURES = (
    (["fly", "flip-roll"], {"report.png": "flip-roll.png"}, "flip-roll.gif"),
    (["compare", "section-v", "--vehicle", "section-v"], {"compare.png": "compare-section-v.png"}, None),
)

out = Path(sys.argv[1] if len(sys.argv) > 1 else "docs")
out.mkdir(parents=True, exist_ok=True)
for command, names, video in PICTURES:
    with tempfile.TemporaryDirectory() as folder:
        main([*command, "--out", folder])
        for made, name in names.items():
            shutil.copyfile(Path(folder) / made, out / name)
        if video is not None:
            main(["view", folder, "--video", str(out / video)])
