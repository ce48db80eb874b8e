"""Tables with a vector for each mode of a body: components are rows, modes are columns.

`column6` and the like take the column of one mode; `strips6` and the like take the columns of a strip of modes at once
(`flexmb.jit.strips`), to which the functions of `flexmb.spatial` apply as to single columns.
"""

from flexmb.jit.kernel import helper
from flexmb.jit.strips import put, strip, total


@helper
def column3(a, i, n):
    """Rows i, i+1, i+2 in column n."""
    return a[i, n], a[i + 1, n], a[i + 2, n]


@helper
def column6(a, n):
    """Column n of six rows."""
    return column3(a, 0, n), column3(a, 3, n)


@helper
def column_sym(a, n):
    """Column n of six rows as a symmetric matrix."""
    return a[0, n], a[1, n], a[2, n], a[3, n], a[4, n], a[5, n]


@helper
def store_column3(a, i, n, v):
    a[i, n] = v[0]
    a[i + 1, n] = v[1]
    a[i + 2, n] = v[2]


@helper
def store_column6(a, n, V):
    store_column3(a, 0, n, V[0])
    store_column3(a, 3, n, V[1])


@helper
def strips3(w, a, i, n):
    """Strips of rows i, i+1, i+2 that start at column n."""
    return strip(w, a[i], n), strip(w, a[i + 1], n), strip(w, a[i + 2], n)


@helper
def strips6(w, a, n):
    """Strips of six rows that start at column n."""
    return strips3(w, a, 0, n), strips3(w, a, 3, n)


@helper
def put3(w, a, i, n, v):
    put(w, a[i], n, v[0])
    put(w, a[i + 1], n, v[1])
    put(w, a[i + 2], n, v[2])


@helper
def put6(w, a, n, V):
    put3(w, a, 0, n, V[0])
    put3(w, a, 3, n, V[1])


@helper
def total3(w, v):
    """The sum over the modes of a strip."""
    return total(w, v[0]), total(w, v[1]), total(w, v[2])


@helper
def total6(w, V):
    return total3(w, V[0]), total3(w, V[1])


@helper
def total_sym(w, s):
    """The sum over the modes of a strip of symmetric matrices."""
    return total(w, s[0]), total(w, s[1]), total(w, s[2]), total(w, s[3]), total(w, s[4]), total(w, s[5])


@helper
def axpy3(v, x, rows):
    """rows + v x': three rows, to each of which x times one component of v is added."""
    return v[0] * x + rows[0], v[1] * x + rows[1], v[2] * x + rows[2]


@helper
def column_inertia(a):
    """The symmetric matrix in the first six columns of six rows as a spatial inertia."""
    return (
        (a[0, 0], a[1, 1], a[2, 2], a[0, 1], a[0, 2], a[1, 2]),
        (a[0, 3], a[0, 4], a[0, 5], a[1, 3], a[1, 4], a[1, 5], a[2, 3], a[2, 4], a[2, 5]),
        (a[3, 3], a[4, 4], a[5, 5], a[3, 4], a[3, 5], a[4, 5]),
    )
