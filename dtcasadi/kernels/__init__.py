"""Per-segment and per-disc CasADi SX kernels; `dtcasadi.assemble` walks the chain with them.

A kernel is a function of SX matrices (and static words) that returns SX matrices. It uses no
`if_else`, so that its generated C also compiles for a SIMD type.
"""
