"""The recipe of a case's reference for `crosscheck regenerate`: the table `[reference]` of run.toml.

For example::

    [reference]
    variant = "rigid"
    samples = 101                     # [the variant's]
    horizon_s = 8.0                   # [the whole run] how long the motion is known: a chaotic one only so far
    channels = ["marker", "load"]     # [all that two routes offer]
    engines = ["native", "mujoco"]    # [those that a comparison expects to agree on the variant] held against it
    goals = { marker = 1e-7 }         # [those of that comparison]

    [[reference.route]]               # the first route that offers a channel gives its values
    exact = "exact.py"                # a closed form, in the case's folder
    relative_uncertainty = 1e-13

    [[reference.route]]
    engine = "native"                 # efforts [the variant's or the engine's own]
    efforts = [{ engine = "native", kind = "tolerance", method = "dop853", values = [1e-10, 1e-11, 1e-12] }]

    [[reference.route]]
    engine = "native-frisch"

    [[reference.route]]
    engine = "exudyn"                 # another code, which comes less near: it must agree, and is told with its E
    witness = true
    channels = ["marker:*.position"]  # [all that the reference has]

Every channel needs at least two routes, which must agree within their uncertainties and be independent: a closed
form and any other, two codes, or two of this library's engines with two integrators. The samples are some of the
variant's: with 251 of these, 126 or 51 can be kept. `docs/references.md` has all rules.
"""

from __future__ import annotations

from typing import Literal

import msgspec


class EffortLadder(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Efforts that replace an engine's own ladder for a variant: `values` from coarse to fine, at least two."""

    engine: str
    kind: Literal["tolerance", "step"]
    method: str
    values: tuple[float, ...]


class ReferenceRoute(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """One way to the numbers: an `engine` with its `efforts`, a closed form, or equations of the case's own.

    `exact` and `equations` name a Python file in the case's folder with a function `exact(times)` that returns channels
    (T, k) by name: a closed form, or equations of motion that the file states and integrates by itself;
    `relative_uncertainty` says how well they are evaluated, relative to each channel's range. `variant` replaces the
    reference's variant, by another model of the same physics. `channels` are patterns of the channels that it gives,
    by default all. A `witness` must agree within both uncertainties as any route must, but its distance does not enter
    the stated uncertainty: another code that is known less well than the routes before it.
    """

    engine: str = ""
    exact: str = ""
    equations: str = ""
    channels: tuple[str, ...] = ()
    witness: bool = False
    variant: str | None = None
    efforts: tuple[EffortLadder, ...] = ()
    relative_uncertainty: float = 1e-13


class ReferenceRecipe(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """The contents of `reference.csv`, its routes, and the engines and channels that are compared with it.

    `manufactured` is the command that wrote the reference instead of routes: a prescribed motion, and its loads.
    """

    variant: str
    manufactured: str = ""
    samples: int | None = None
    horizon_s: float | None = None
    channels: tuple[str, ...] = ()
    engines: tuple[str, ...] = ()
    goals: dict[str, float] = {}
    routes: tuple[ReferenceRoute, ...] = msgspec.field(name="route", default=())
