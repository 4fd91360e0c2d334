"""Plans in the files of other systems: `export`, with one module for each format and the loss of each."""

from aerobat.interchange.exports.export import FORMATS as FORMATS
from aerobat.interchange.exports.export import Export as Export
from aerobat.interchange.exports.export import export as export
from aerobat.interchange.exports.loss import Loss as Loss
