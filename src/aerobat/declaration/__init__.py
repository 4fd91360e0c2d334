"""One declaration a field: frozen values checked by pydantic, from Python and from files alike.

A class is declared once, with `@declared` and a type for each field; calling it and reading it from a table
then run through the same checks, and whatever is wrong becomes one sentence that names the field.
"""

from aerobat.declaration.declared import declared
from aerobat.declaration.field_types import (
    AS_IT_IS,
    Corner,
    Count,
    Direction,
    Fraction,
    Label,
    Limit,
    NonNegative,
    Number,
    PartialVector,
    PerAxis,
    Positive,
    UnitVector,
    Vector3,
    finite,
    number,
    unit,
)
from aerobat.declaration.registry import Registry, import_plugin
from aerobat.declaration.sentences import FieldError, shown, unknown_key, unknown_name, within_field
from aerobat.declaration.tables import from_table, to_table

__all__ = [
    "AS_IT_IS",
    "Corner",
    "Count",
    "Direction",
    "FieldError",
    "Fraction",
    "Label",
    "Limit",
    "NonNegative",
    "Number",
    "PartialVector",
    "PerAxis",
    "Positive",
    "Registry",
    "UnitVector",
    "Vector3",
    "declared",
    "finite",
    "from_table",
    "import_plugin",
    "number",
    "shown",
    "to_table",
    "unit",
    "unknown_key",
    "unknown_name",
    "within_field",
]
