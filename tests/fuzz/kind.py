"""One kind of file: good ones to start from, mutations, the reader, and when an accept is wrong."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from tests.fuzz import mutate

Accept = Callable[[Path], "str | None"]


@dataclass(frozen=True)
class Kind:
    """`file` is its name in the working folder, `refusals` the documented errors, which contain `place`."""

    file: str
    seeds: tuple[bytes, ...]
    mutations: tuple[mutate.Mutation, ...]
    refusals: tuple[type[BaseException], ...]
    accept: Accept
    place: str = ""
