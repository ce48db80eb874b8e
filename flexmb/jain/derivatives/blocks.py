"""Blocks of columns: four strips as one value, and six of them as the spatial vectors of all these columns."""

from flexmb.jain.derivatives.columns import zero
from flexmb.jit.kernel import helper
from flexmb.jit.strips import put, strip, width


@helper
def block(d, row, n):
    """Four strips from element n of a row on."""
    s = width(d)
    return strip(d, row, n), strip(d, row, n + s), strip(d, row, n + 2 * s), strip(d, row, n + 3 * s)


@helper
def put_block(d, row, n, x):
    s = width(d)
    put(d, row, n, x[0])
    put(d, row, n + s, x[1])
    put(d, row, n + 2 * s, x[2])
    put(d, row, n + 3 * s, x[3])


@helper
def block6(d, a):
    """Six rows of a block."""
    return (
        block(d, a[0], 0), block(d, a[1], 0), block(d, a[2], 0),
        block(d, a[3], 0), block(d, a[4], 0), block(d, a[5], 0),
    )  # fmt: skip


@helper
def put_block6(d, a, V):
    put_block(d, a[0], 0, V[0])
    put_block(d, a[1], 0, V[1])
    put_block(d, a[2], 0, V[2])
    put_block(d, a[3], 0, V[3])
    put_block(d, a[4], 0, V[4])
    put_block(d, a[5], 0, V[5])


@helper
def scaled(s, x):
    return s * x[0], s * x[1], s * x[2], s * x[3]


@helper
def plus(s, x, y):
    """s x + y."""
    return s * x[0] + y[0], s * x[1] + y[1], s * x[2] + y[2], s * x[3] + y[3]


@helper
def less(x, y):
    """x - y."""
    return x[0] - y[0], x[1] - y[1], x[2] - y[2], x[3] - y[3]


@helper
def minus_sum(x, y):
    """-x - y."""
    return -x[0] - y[0], -x[1] - y[1], -x[2] - y[2], -x[3] - y[3]


@helper
def sum_block(x, y):
    return x[0] + y[0], x[1] + y[1], x[2] + y[2], x[3] + y[3]


@helper
def sum_block6(V, W):
    return (
        sum_block(V[0], W[0]), sum_block(V[1], W[1]), sum_block(V[2], W[2]),
        sum_block(V[3], W[3]), sum_block(V[4], W[4]), sum_block(V[5], W[5]),
    )  # fmt: skip


@helper
def along(J, V):
    """J . V of a motion or force J with six blocks."""
    a, b = J
    first = plus(a[2], V[2], plus(a[1], V[1], scaled(a[0], V[0])))
    return sum_block(first, plus(b[2], V[5], plus(b[1], V[4], scaled(b[0], V[3]))))


@helper
def plus6(J, x, V):
    """J x + V."""
    a, b = J
    return (
        plus(a[0], x, V[0]), plus(a[1], x, V[1]), plus(a[2], x, V[2]),
        plus(b[0], x, V[3]), plus(b[1], x, V[4]), plus(b[2], x, V[5]),
    )  # fmt: skip


@helper
def no_block6(d, row):
    """Six blocks of zeros, of the type of those in a row."""
    nothing = zero(d, row)
    x = nothing, nothing, nothing, nothing
    return x, x, x, x, x, x


@helper
def shift_forces(V, d):
    """phi F of six blocks."""
    a, b, c, x, y, z = V
    return (
        plus(-d[2], y, plus(d[1], z, a)), plus(-d[0], z, plus(d[2], x, b)), plus(-d[1], x, plus(d[0], y, c)), x, y, z,
    )  # fmt: skip


@helper
def shift_motions(V, d):
    """phi' A of six blocks: the linear part + angular x d."""
    a, b, c, x, y, z = V
    return (
        a, b, c, plus(d[2], b, plus(-d[1], c, x)), plus(d[0], c, plus(-d[2], a, y)), plus(d[1], a, plus(-d[0], b, z)),
    )  # fmt: skip
