"""Pages that stand outside of docs/, as parts of the site: copies whose links lead where they led."""

import os
import re
from pathlib import Path

from sphinx.application import Sphinx

ROOT = Path(__file__).parents[2]
LINK = re.compile(r"(?<=\]\()([^)\s#:]+)(?=[)#])")


def copies(generated: Path) -> dict[Path, Path]:
    """Each page, and where its copy stands."""
    notes = sorted((ROOT / "src").rglob("DERIVATION.md"))
    copied = {ROOT / name: generated / name.lower() for name in ("CONTRIBUTING.md", "CHANGELOG.md")}
    return copied | {note: generated / "derivations" / f"{note.parent.name}.md" for note in notes}


def write(generated: Path) -> None:
    """Write all copies."""
    (generated / "derivations").mkdir(parents=True, exist_ok=True)
    for page, copy in copies(generated).items():
        copy.write_text(relinked(page.read_text(encoding="utf-8"), page, copy, generated), encoding="utf-8")


def relink(app: Sphinx, name: str, source: list[str]) -> None:
    """Let a page's links to what is copied lead to the copy."""
    page = Path(app.env.doc2path(name))
    if page.suffix == ".md":
        source[0] = relinked(source[0], page, page, Path(app.srcdir) / "generated")


def relinked(text: str, page: Path, place: Path, generated: Path) -> str:
    """The text of a page as it is to stand in another place.

    Args:
        text: Markdown.
        page: From where its links lead.
        place: Where it shall stand.
        generated: The folder of the copies.
    """
    known = copies(generated)

    def moved(link: re.Match[str]) -> str:
        target = (page.parent / link[1]).resolve()
        if target not in known and place == page:
            return link[1]
        return Path(os.path.relpath(known.get(target, target), place.parent)).as_posix()

    return LINK.sub(moved, text)
