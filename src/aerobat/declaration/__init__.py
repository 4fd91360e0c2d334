"""One declaration a field: frozen values checked by pydantic, from Python and from files alike.

A class is declared once, with `@declared` and a type for each field; calling it and reading it from a table
then run through the same checks, and whatever is wrong becomes one sentence that names the field.
"""

from aerobat.declaration.angles import in_degrees, in_radians
from aerobat.declaration.declared import declared
from aerobat.declaration.field_types import (
    AS_IT_IS,
    Angle,
    Corner,
    Count,
    Derivative,
    Direction,
    Finite,
    Fraction,
    Gravity,
    Label,
    Limit,
    NonNegative,
    Number,
    PartialVector,
    PathName,
    PerAxis,
    Positive,
    Seed,
    Series,
    TiltLimit,
    UnitVector,
    Vector3,
    VectorLike,
    finite,
    number,
    unit,
)
from aerobat.declaration.notebooks import in_notebooks
from aerobat.declaration.registry import Registry, import_plugin, placed
from aerobat.declaration.sentences import (
    FieldError,
    missing_fields,
    shown,
    unknown_key,
    unknown_name,
    within_field,
)
from aerobat.declaration.tables import from_table, to_table
from aerobat.declaration.validated import suggest_for, validated
from aerobat.declaration.values import by_value, short

__all__ = [
    "AS_IT_IS",
    "Angle",
    "Corner",
    "Count",
    "Derivative",
    "Direction",
    "FieldError",
    "Finite",
    "Fraction",
    "Gravity",
    "Label",
    "Limit",
    "NonNegative",
    "Number",
    "PartialVector",
    "PathName",
    "PerAxis",
    "Positive",
    "Registry",
    "Seed",
    "Series",
    "TiltLimit",
    "UnitVector",
    "Vector3",
    "VectorLike",
    "by_value",
    "declared",
    "finite",
    "from_table",
    "import_plugin",
    "in_degrees",
    "in_notebooks",
    "in_radians",
    "missing_fields",
    "number",
    "placed",
    "short",
    "shown",
    "suggest_for",
    "to_table",
    "unit",
    "unknown_key",
    "unknown_name",
    "validated",
    "within_field",
]
