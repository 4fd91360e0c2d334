"""A user's own maneuvers and planners, registered before the command line reads its options."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

FLAG = "--import"


def import_plugins(tokens: Sequence[str]) -> None:
    """Run the Python files that `--import` names: what they register is then known by its name.

    Their planners bring options of their own, which is why this comes before the options are read. Raises
    SpecError when there is no such file or it fails.
    """
    for path in _values(tokens):
        from aerobat.declaration import import_plugin

        import_plugin(path)


def _values(tokens: Sequence[str]) -> Iterator[str]:
    for token, following in zip(tokens, [*tokens[1:], ""], strict=True):
        if token == FLAG and following:
            yield following
        elif token.startswith(f"{FLAG}="):
            yield token.removeprefix(f"{FLAG}=")
