"""One file per force; each gives wrenches on discs, projected by the same recursion."""
