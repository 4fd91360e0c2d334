"""Declarations of fields: frozen values checked by pydantic, from Python and from files alike.

A class is declared once, with `@declared` and a type for each field. Calls from Python and tables from files
pass the same checks, and every error is one sentence that names the field.
"""

from aerobat.declaration.declared import declared as declared
from aerobat.declaration.declared import from_table as from_table
from aerobat.declaration.declared import to_table as to_table
from aerobat.declaration.field_types import AS_IT_IS as AS_IT_IS
from aerobat.declaration.field_types import Angle as Angle
from aerobat.declaration.field_types import Corner as Corner
from aerobat.declaration.field_types import Count as Count
from aerobat.declaration.field_types import Derivative as Derivative
from aerobat.declaration.field_types import Direction as Direction
from aerobat.declaration.field_types import Finite as Finite
from aerobat.declaration.field_types import Fraction as Fraction
from aerobat.declaration.field_types import Gravity as Gravity
from aerobat.declaration.field_types import Label as Label
from aerobat.declaration.field_types import Limit as Limit
from aerobat.declaration.field_types import NonNegative as NonNegative
from aerobat.declaration.field_types import Number as Number
from aerobat.declaration.field_types import PartialVector as PartialVector
from aerobat.declaration.field_types import PathName as PathName
from aerobat.declaration.field_types import PerAxis as PerAxis
from aerobat.declaration.field_types import Positive as Positive
from aerobat.declaration.field_types import Repeats as Repeats
from aerobat.declaration.field_types import Seed as Seed
from aerobat.declaration.field_types import Series as Series
from aerobat.declaration.field_types import TiltLimit as TiltLimit
from aerobat.declaration.field_types import UnitVector as UnitVector
from aerobat.declaration.field_types import Vector3 as Vector3
from aerobat.declaration.field_types import VectorLike as VectorLike
from aerobat.declaration.field_types import finite as finite
from aerobat.declaration.field_types import in_degrees as in_degrees
from aerobat.declaration.field_types import number as number
from aerobat.declaration.field_types import positive as positive
from aerobat.declaration.field_types import unit as unit
from aerobat.declaration.sentences import FieldError as FieldError
from aerobat.declaration.sentences import missing_fields as missing_fields
from aerobat.declaration.sentences import shown as shown
from aerobat.declaration.sentences import unknown_key as unknown_key
from aerobat.declaration.sentences import unknown_name as unknown_name
from aerobat.declaration.sentences import within_field as within_field
from aerobat.declaration.validated import suggest_for as suggest_for
from aerobat.declaration.validated import validated as validated
from aerobat.declaration.values import by_value as by_value
from aerobat.declaration.values import in_notebooks as in_notebooks
from aerobat.declaration.values import short as short
