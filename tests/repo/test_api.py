"""Every public name of the Python interface is there, under the name the documentation promises."""

import ast
import inspect
import re
from typing import get_args, get_type_hints

import pytest

import flexmb as fm
from flexmb.scene import schema
from tests.repo.project import ROOT

FUNCTIONS = {
    "load_scene": ["path"], "compile": ["scene"], "linearize": ["system", "state"], "equilibrium": ["system", "guess"],
    "equilibrium_path": ["scene", "number", "values"], "steady_spin": ["system", "hinge", "rate"],
    "base_excitation": ["system", "state", "held"], "campbell": ["system", "hinge", "rates"],
    "advise": ["scene", "tolerance", "quantity", "t_end"], "random_response": ["model", "densities", "outputs"],
    "linearize_sampled": ["system", "period", "state", "held"], "stability_map": ["scene", "values"],
    "simulate": ["scene", "t_end", "method", "rtol", "atol", "algorithm"],
    "simulate_batch": ["copies", "t_end", "method", "q", "u", "threads", "rtol"], "compile_batch": ["scenes"],
}  # fmt: skip
SYSTEM = {
    "coordinate": ["name"], "speed": ["name"], "state": ["q", "u"], "accelerations": ["state", "algorithm"],
    "partitions": ["state", "algorithm"], "mass_matrix": ["state"], "bias": ["state"], "inverse_dynamics": ["state"],
    "hinge_loads": ["state"], "energy": ["state"], "momentum": ["state"],
}  # fmt: skip
TRAJECTORY = ("t", "q", "u", "markers", "loads", "energy", "to_csv")


def _parameters(function: object) -> set[str]:
    """Names of its arguments, those of a TypedDict that it unpacks included."""
    found = inspect.signature(function).parameters  # type: ignore[arg-type]
    packed = [name for name, each in found.items() if each.kind is inspect.Parameter.VAR_KEYWORD]
    hints = get_type_hints(function, include_extras=True) if packed else {}
    unpacked = [get_args(hints[name])[0] for name in packed]
    return {*found, *(key for each in unpacked for key in each.__annotations__)}


@pytest.mark.parametrize("name", FUNCTIONS)
def test_function(name: str) -> None:
    assert set(FUNCTIONS[name]) <= _parameters(getattr(fm, name))


def test_scene_builder() -> None:
    scene = fm.SceneBuilder("empty", gravity=(0, 0, -9.81)).rigid_body("a", mass=1, inertia=(1, 1, 1))
    assert fm.compile(scene.free("h", "ground", "a").scene())


@pytest.mark.parametrize("name", SYSTEM)
def test_system(name: str) -> None:
    assert set(SYSTEM[name]) <= _parameters(getattr(fm.System, name))


def test_initial_state_is_a_value() -> None:
    assert isinstance(inspect.getattr_static(fm.System, "initial_state"), property)


def test_trajectory() -> None:
    fields = {name for kind in fm.Trajectory.__mro__ for name in (*vars(kind), *vars(kind).get("__annotations__", ()))}
    assert set(TRAJECTORY) <= fields


def test_type_checkers_see_the_public_names() -> None:
    """Each is imported under its own name, hence exported, from the module that has it when the program runs."""
    tree = ast.parse((ROOT / "flexmb" / "__init__.py").read_text(encoding="utf-8"))
    (block,) = [each for each in tree.body if isinstance(each, ast.If)]
    imports = [each for each in block.body if isinstance(each, ast.ImportFrom)]
    seen = {alias.asname: each.module for each in imports for alias in each.names if alias.name == alias.asname}
    assert seen == fm._MODULE_OF | {"schema": "flexmb.scene"}
    every = {each.module for each in imports if each.names[0].name == "*"}
    # mypy does not follow what the schema adds to its __all__ from the other two
    assert every == {"flexmb.scene.schema", "flexmb.scene.hinges", "flexmb.scene.connectors"}
    assert all(name[0].isupper() for name in schema.__all__)


def test_every_public_name_is_on_a_page() -> None:
    """Names of the schema are on the page of scenes, which lists all of them."""
    pages = "".join(page.read_text(encoding="utf-8") for page in (ROOT / "docs" / "api").glob("*.md"))
    assert set(re.findall(r"auto\w+:: flexmb\.(\w+)$", pages, re.MULTILINE)) == set(fm._MODULE_OF)
    assert "automodule:: flexmb.scene.schema\n   :members:" in pages
