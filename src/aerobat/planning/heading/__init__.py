"""The heading that a problem asks for, followed beside a path that is planned already."""
