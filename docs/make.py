"""Make every generated page, schema, notebook, picture and lock anew.

uv run --dev python docs/make.py [NAMES]
"""

from __future__ import annotations

import argparse
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parent.parent
PYTHON = sys.executable
LOCKED = "export --no-dev --no-emit-project --format requirements-txt --output-file requirements.lock"
MADE: dict[str, tuple[list[str], ...]] = {  # of each name its commands, quick ones first
    "files": ([PYTHON, "docs/make_files_page.py"],),
    "schema": ([PYTHON, "docs/make_plan_schema.py"],),
    "lock": (["uv", "lock"], ["uv", *LOCKED.split()]),  # hashes, no addresses
    "tutorial": ([PYTHON, "docs/make_tutorial.py"],),
    "pictures": ([PYTHON, "examples/readme_pictures.py", "docs"],),
    "replay": ([PYTHON, "docs/make_replay_picture.py"],),
    "figures": ([PYTHON, "examples/paper_figures.py", "docs/figures"],),
}


def main() -> None:
    """Run the commands of the names that are given, or of all."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("names", nargs="*", metavar="NAMES", help=", ".join(MADE))
    names = parser.parse_args().names or list(MADE)
    if unknown := set(names) - set(MADE):
        parser.error(f"{', '.join(sorted(unknown))}: nothing has that name; known: {', '.join(MADE)}")
    for name in names:
        print(f"{name}", flush=True)
        for command in MADE[name]:
            subprocess.run(command, cwd=ROOT, check=True, stdout=subprocess.DEVNULL)


if __name__ == "__main__":
    main()
