"""Two ways to call a kernel: inlined into one flat SX graph, or as a Function in an MX call graph.

Both run the same kernels with the same recursion (`dtcasadi.chain`). The flat graph is fastest for
few discs; the call graph's C code hardly grows with their number.
"""

from collections.abc import Callable, Hashable
from typing import Any

import casadi as ca
import numpy as np

Tree = Any  # nested tuples of matrices and static values (words, flags)
Built = tuple[ca.Function, Callable[[list], Tree]]

# Kernels' Functions of all models of this process: models of one robot that differ in size or
# options share most of them. Emptied when full.
_SHARED: dict[tuple, Built] = {}
_MOST_SHARED = 4096


def flatten(tree: Tree) -> tuple[list, Callable[[list], Tree]]:
    """The matrices of nested tuples, and how to put others in their places."""
    if isinstance(tree, ca.SX | ca.MX | ca.DM):
        return [tree], lambda leaves: leaves[0]
    if isinstance(tree, tuple):
        parts = [flatten(item) for item in tree]
        sizes = np.cumsum([0] + [len(leaves) for leaves, _ in parts])

        def rebuild(leaves: list) -> Tree:
            items = [build(leaves[sizes[n] : sizes[n + 1]]) for n, (_, build) in enumerate(parts)]
            return type(tree)(*items) if hasattr(tree, "_fields") else tuple(items)

        return [leaf for leaves, _ in parts for leaf in leaves], rebuild
    return [], lambda leaves: tree


def _static(tree: Tree) -> Tree:
    """What is not a matrix, as a hashable key."""
    if isinstance(tree, ca.SX | ca.MX | ca.DM):
        return None
    if isinstance(tree, tuple):
        return tuple(_static(item) for item in tree)
    return tree


def _pattern(sparsity: ca.Sparsity) -> Hashable:
    """A pattern as a key, most often that of a dense matrix."""
    return sparsity.shape if sparsity.is_dense() else str(sparsity.compress())


class Flat:
    """Kernels inlined: every expression is SX."""

    sym = staticmethod(ca.SX.sym)
    expression = ca.SX

    def call(self, kernel: Callable, *args: Tree) -> Tree:
        """The kernel's result on the arguments, robot numbers folded in."""
        leaves, rebuild = flatten(args)
        return kernel(*rebuild([ca.SX(leaf) for leaf in leaves]))


class Graph:
    """Kernels as SX Functions called from an MX graph, one for each kind of arguments."""

    sym = staticmethod(ca.MX.sym)
    expression = ca.MX

    def __init__(self, prefix: str = "seg"):
        self._prefix = prefix
        self._built: dict[tuple, Built] = {}

    def call(self, kernel: Callable, *args: Tree) -> Tree:
        """A call of the kernel's Function; its inputs take over the arguments' sparsity."""
        leaves, rebuild = flatten(args)
        leaves = [ca.sparsify(leaf) if isinstance(leaf, ca.DM) else leaf for leaf in leaves]
        shapes = tuple(_pattern(leaf.sparsity()) for leaf in leaves)
        key = (kernel.__module__, kernel.__name__, _static(args), shapes)
        if key not in self._built:
            self._built[key] = self._shared(kernel, key, leaves, rebuild)
        function, restore = self._built[key]
        if all(isinstance(leaf, ca.DM) for leaf in leaves):  # numbers give numbers
            return restore([ca.sparsify(result) for result in function.call(leaves)])
        results = function.call([leaf if type(leaf) is ca.MX else ca.MX(leaf) for leaf in leaves])
        return restore(list(results))

    def _shared(self, kernel: Callable, key: tuple, leaves: list, rebuild: Callable) -> Built:
        name = f"{self._prefix}_{kernel.__name__.strip('_')}_{len(self._built)}"
        if getattr(kernel, "__closure__", None):  # depends on more than its arguments
            return self._build(name, kernel, leaves, rebuild)
        if (name, key) not in _SHARED:
            if len(_SHARED) >= _MOST_SHARED:
                _SHARED.clear()
            _SHARED[name, key] = self._build(name, kernel, leaves, rebuild)
        return _SHARED[name, key]

    @staticmethod
    def _build(name: str, kernel: Callable, leaves: list, rebuild: Callable) -> Built:
        inputs = [ca.SX.sym(f"a{n}", leaf.sparsity()) for n, leaf in enumerate(leaves)]
        outputs, restore = flatten(kernel(*rebuild(inputs)))
        outputs = [ca.sparsify(ca.SX(out)) for out in outputs]
        return ca.Function(name, inputs, outputs, {"cse": True}), restore
