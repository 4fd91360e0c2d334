"""Plans in the files of other systems: `export`, one module a format, and what each loses."""

from aerobat.interchange.exports.export import FORMATS, Export, export
from aerobat.interchange.exports.loss import Loss

__all__ = ["FORMATS", "Export", "Loss", "export"]
