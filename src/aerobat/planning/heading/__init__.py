"""The heading that a problem asks for, followed beside a path that is planned already."""

from aerobat.planning.heading.follow import HeadingError, heading_error, with_heading

__all__ = ["HeadingError", "heading_error", "with_heading"]
