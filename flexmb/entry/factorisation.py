"""Entry points of the innovations factorisation of a mass matrix, M = F F': Jain & Rodriguez (54)-(56)."""

from flexmb.jain import innovations, precision
from flexmb.jain.response import clear, clear_forces, read_speeds, write_speeds
from flexmb.jit.kernel import helper, kernel
from flexmb.motion.coordinates import load_state
from flexmb.tables.status import NOT_POSITIVE_DEFINITE, OK


@kernel
def factorise(t, y, scene, c, w):
    """Factors to w, with the functions of time of `scene` and the free speeds of c; returns a status code."""
    load_state(t, y, scene, w)
    return OK if innovations.factorise(c, w) else NOT_POSITIVE_DEFINITE


@kernel
def solve(c, w, x, b):
    """Rows of b (m,nu) replaced by M^-1 b."""
    for row in range(b.shape[0]):
        read_speeds(x, b[row])
        answer(c, w, x)
        write_speeds(x, b[row])


@helper
def answer(c, w, x):
    """x.speed := M^-1 x.speed."""
    clear_forces(c, x)
    innovations.innovations(c, w, x)
    innovations.respond(c, w, x)


@kernel
def half_solve(c, w, x, b):
    """Rows of b (m,nu) replaced by F^-1 b."""
    for row in range(b.shape[0]):
        _enter(c, x, b[row])
        innovations.innovations(c, w, x)
        write_speeds(x, b[row])


@kernel
def half_multiply(c, w, x, b):
    """Rows of b (m,nu) replaced by F b."""
    for row in range(b.shape[0]):
        _enter(c, x, b[row])
        innovations.synthesise(c, w, x)
        write_speeds(x, b[row])


@kernel
def multiply(c, w, x, b):
    """Rows of b (m,nu) replaced by M b."""
    for row in range(b.shape[0]):
        _enter(c, x, b[row])
        innovations.excite(c, w, x)
        innovations.synthesise(c, w, x)
        write_speeds(x, b[row])


@kernel
def weigh(c, w, x, y):
    """y (nu,) replaced by F^-1 S'S F'^-1 y, for S of `flexmb.jain.precision`."""
    _enter(c, x, y)
    precision.weigh(c, w, x)
    write_speeds(x, y)


@kernel
def log_determinant(c, w):
    """log det M."""
    return innovations.log_determinant(c, w)


@helper
def _enter(c, x, b):
    """Set the response x to the right-hand side b and no other forces."""
    clear(c, x)
    read_speeds(x, b)
