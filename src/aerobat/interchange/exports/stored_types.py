"""Messages of the types that a store of `rosbags` has."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

_BLANK: Mapping[str, Any] = {"string": "", "bool": False, "float32": 0.0, "float64": 0.0}  # others are whole


@dataclass(frozen=True)
class StoredTypes:
    """A maker of one distribution's messages; see `Make`."""

    store: Any  # of types, a Typestore of `rosbags`

    def __call__(self, kind: str, /, **given: Any) -> Any:
        """See `Make.__call__`."""
        fields = dict(self.store.fielddefs[kind][1])
        return self.store.types[kind](
            **{name: given[name] if name in given else self._blank(node) for name, node in fields.items()}
        )

    def _blank(self, node: Any) -> Any:
        form, content = node
        if form.name == "NAME":
            return self(content)
        if form.name == "BASE":
            return _BLANK.get(content[0], 0)
        (_, element), count = content
        numeric = isinstance(element, tuple) and element[0] != "string"
        return np.zeros(count if form.name == "ARRAY" else 0, dtype=element[0]) if numeric else []
