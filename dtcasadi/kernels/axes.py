"""Small vector and rotation algebra on CasADi SX that keeps structural zeros and ones.

A rotation is given by the cosine and sine of its angle, so that no kernel evaluates a sine twice.
"""

import casadi as ca

AXIS = {"x": 0, "y": 1, "z": 2}


def vector(*entries: object) -> ca.SX:
    """A column of scalars, shape (n, 1)."""
    return ca.vertcat(*entries)


def head(v: ca.SX, k: int) -> ca.SX:
    """The first k entries of a column, a column even when there are none."""
    return ca.vertsplit(v, [0, k, v.shape[0]])[0]


def tail(v: ca.SX, k: int) -> ca.SX:
    """The entries of a column from the k-th, a column even when there are none."""
    return ca.vertsplit(v, [0, k, v.shape[0]])[1]


def unit_axis(letter: str) -> ca.DM:
    """The coordinate axis, shape (3, 1)."""
    axis = ca.DM.zeros(3, 1)
    axis[AXIS[letter]] = 1
    return axis


def rotation(letter: str, c: ca.SX, s: ca.SX) -> ca.SX:
    """Rot(axis, angle), shape (3, 3), from the angle's cosine and sine."""
    i, j, k = _cycle(letter)
    matrix = ca.SX.eye(3)
    matrix[j, j], matrix[j, k] = c, -s
    matrix[k, j], matrix[k, k] = s, c
    return matrix


def word_rotation(word: str, c: ca.SX, s: ca.SX) -> ca.SX:
    """Product of the elementary rotations of a word, shape (3, 3)."""
    matrix = ca.SX.eye(3)
    for n, letter in enumerate(word):
        matrix = ca.mtimes(matrix, rotation(letter, c[n], s[n]))
    return matrix


def into(letter: str, c: ca.SX, s: ca.SX, v: ca.SX) -> ca.SX:
    """Rot(axis, angle)^T v: a vector's components after the turn, shape (3, 1)."""
    i, j, k = _cycle(letter)
    entries = [None] * 3
    entries[i], entries[j], entries[k] = v[i], c * v[j] + s * v[k], c * v[k] - s * v[j]
    return vector(*entries)


def back(letter: str, c: ca.SX, s: ca.SX, v: ca.SX) -> ca.SX:
    """Rot(axis, angle) v: a vector's components before the turn, shape (3, 1)."""
    return into(letter, c, -s, v)


def word_into(word: str, c: ca.SX, s: ca.SX, v: ca.SX) -> ca.SX:
    """R_word^T v, letter by letter, shape (3, 1)."""
    for n, letter in enumerate(word):
        v = into(letter, c[n], s[n], v)
    return v


def word_back(word: str, c: ca.SX, s: ca.SX, v: ca.SX) -> ca.SX:
    """R_word v, letter by letter, shape (3, 1)."""
    for n, letter in reversed(list(enumerate(word))):
        v = back(letter, c[n], s[n], v)
    return v


def axes_at_end(word: str, c: ca.SX, s: ca.SX) -> ca.SX:
    """The word's rotation axes in its end frame, shape (3, n): columns of E, eq (3)."""
    columns = []
    for n, letter in enumerate(word):
        axis = ca.SX(ca.densify(unit_axis(letter)))
        columns.append(word_into(word[n + 1 :], tail(c, n + 1), tail(s, n + 1), axis))
    return ca.horzcat(*columns) if columns else ca.SX(3, 0)


def skew(v: ca.SX) -> ca.SX:
    """Cross-product matrix [v]x, shape (3, 3): [v]x w = v x w."""
    return ca.blockcat([[0, -v[2], v[1]], [v[2], 0, -v[0]], [-v[1], v[0], 0]])


def cross(a: ca.SX, b: ca.SX) -> ca.SX:
    """A x b, shape (3, 1)."""
    return vector(a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


def ldl(matrix: ca.SX) -> tuple[list[list], list]:
    """Unrolled LDL^T of a small symmetric positive definite matrix: (L below the diagonal, 1/d)."""
    n = matrix.shape[0]
    lower: list[list] = [[None] * n for _ in range(n)]
    diagonal: list = []
    inverse: list = []
    for j in range(n):
        d = matrix[j, j] - sum(lower[j][k] ** 2 * diagonal[k] for k in range(j))
        diagonal.append(d)
        inverse.append(1 / d)
        for i in range(j + 1, n):
            off = sum(lower[i][k] * lower[j][k] * diagonal[k] for k in range(j))
            lower[i][j] = (matrix[i, j] - off) * inverse[j]
    return lower, inverse


def ldl_solve(factor: tuple[list[list], list], rhs: ca.SX) -> ca.SX:
    """X with (L D L^T) X = rhs, shape (n, m)."""
    lower, inverse = factor
    n = len(inverse)
    columns = []
    for column in ca.horzsplit(rhs):
        y: list = []
        for i in range(n):
            y.append(column[i] - sum(lower[i][k] * y[k] for k in range(i)))
        y = [y[i] * inverse[i] for i in range(n)]
        for i in reversed(range(n)):
            y[i] = y[i] - sum(lower[k][i] * y[k] for k in range(i + 1, n))
        columns.append(vector(*y))
    return ca.horzcat(*columns) if columns else ca.SX(n, 0)


def lu(matrix: ca.SX) -> tuple[list[list], list]:
    """Unrolled LU without pivoting: (rows of L below and U from the diagonal, 1/u_ii)."""
    n = matrix.shape[0]
    rows: list[list] = [[matrix[i, j] for j in range(n)] for i in range(n)]
    inverse: list = []
    for k in range(n):
        inverse.append(1 / rows[k][k])
        for i in range(k + 1, n):
            rows[i][k] = rows[i][k] * inverse[k]
            for j in range(k + 1, n):
                rows[i][j] = rows[i][j] - rows[i][k] * rows[k][j]
    return rows, inverse


def lu_solve(factor: tuple[list[list], list], rhs: ca.SX) -> ca.SX:
    """X with (L U) X = rhs, shape (n, m)."""
    rows, inverse = factor
    n = len(inverse)
    columns = []
    for column in ca.horzsplit(rhs):
        y: list = []
        for i in range(n):
            y.append(column[i] - sum(rows[i][k] * y[k] for k in range(i)))
        for i in reversed(range(n)):
            y[i] = (y[i] - sum(rows[i][k] * y[k] for k in range(i + 1, n))) * inverse[i]
        columns.append(vector(*y))
    return ca.horzcat(*columns)


def _cycle(letter: str) -> tuple[int, int, int]:
    """The axis and the two that follow it cyclically."""
    i = AXIS[letter]
    return i, (i + 1) % 3, (i + 2) % 3
