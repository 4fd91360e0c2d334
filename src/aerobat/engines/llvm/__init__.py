"""Kernels as machine code, compiled by LLVM in a moment; see DERIVATION.md."""

from aerobat.engines.llvm.engine import ENGINE

__all__ = ["ENGINE"]
