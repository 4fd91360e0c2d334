"""Kernels as machine code, compiled by LLVM; see DERIVATION.md."""
