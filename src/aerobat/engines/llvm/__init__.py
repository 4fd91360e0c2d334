"""Kernels as machine code, compiled by LLVM; see DERIVATION.md."""

from aerobat.engines.llvm.engine import ENGINE

__all__ = ["ENGINE"]
