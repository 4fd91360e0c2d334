"""Plans in the files of other systems: `export`, with one module for each format and the loss of each."""

from aerobat.interchange.exports.export import FORMATS, Export, export
from aerobat.interchange.exports.loss import Loss

__all__ = ["FORMATS", "Export", "Loss", "export"]
