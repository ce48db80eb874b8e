"""Spatial vectors of all modes of a strip, or of all sources, in six rows of a table that begin at a given row."""

from flexmb.jain.derivatives.columns import put_until
from flexmb.jit.kernel import helper
from flexmb.spatial.rows import column3, put3, strips3


@helper
def six_of(a, row, n):
    """Column n of six rows from `row` on."""
    return column3(a, row, n), column3(a, row + 3, n)


@helper
def strips_of(w, a, row, n):
    """The same of a strip of columns that starts at n."""
    return strips3(w, a, row, n), strips3(w, a, row + 3, n)


@helper
def put_strips(w, a, row, n, V):
    """Write six rows of a strip of columns."""
    put3(w, a, row, n, V[0])
    put3(w, a, row + 3, n, V[1])


@helper
def put3_until(w, a, row, n, count, v):
    """Write three rows of the first `count` columns of a strip."""
    put_until(w, a[row], n, count, v[0])
    put_until(w, a[row + 1], n, count, v[1])
    put_until(w, a[row + 2], n, count, v[2])


@helper
def put_strips_until(w, a, row, n, count, V):
    """Write six rows of the first `count` columns of a strip."""
    put3_until(w, a, row, n, count, V[0])
    put3_until(w, a, row + 3, n, count, V[1])
