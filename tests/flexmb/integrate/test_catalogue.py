"""Integrators declare themselves, and what follows from their declarations agrees with them."""

from __future__ import annotations

import re
from importlib import import_module
from pkgutil import iter_modules
from typing import get_args

import pytest

import flexmb as fm
from flexmb import integrate
from flexmb.integrate.catalogue import INTEGRATORS, integrator
from flexmb.integrate.integrator import Integrator, Method
from flexmb.integrate.settings import Settings
from flexmb.run.simulate import RunSettings
from flexmb.run.warm_up import pendulum
from tests.repo.project import ROOT


def test_names_for_type_checkers_are_those_of_the_catalogue():
    assert get_args(Method) == tuple(INTEGRATORS)
    assert all(name == integrator.name for name, integrator in INTEGRATORS.items())


def test_every_declaration_is_in_the_catalogue():
    modules = [import_module(f"flexmb.integrate.{module.name}") for module in iter_modules(integrate.__path__)]
    declared = [each for module in modules for each in vars(module).values() if isinstance(each, Integrator)]
    assert len(declared) == len(INTEGRATORS)
    assert all(INTEGRATORS[each.name] is each for each in declared)


def test_the_table_of_the_documentation_says_the_same():
    text = (ROOT / "docs" / "integrators.md").read_text(encoding="utf-8")
    text = text[text.index("| method | order |") :].partition("\n\n")[0]
    rows = {
        name: (int(order), steps)
        for name, order, steps in re.findall(r"^\| `(\w+)` \| (\d+)[^|]* \| ([^|]+) \|", text, re.MULTILINE)
    }
    said = {
        name: (integrator.order, "`step`" if integrator.fixed else "by rtol, atol")
        for name, integrator in INTEGRATORS.items()
    }
    assert rows == said


def test_simulate_takes_every_setting():
    assert set(RunSettings.__annotations__) == set(Settings.__dataclass_fields__) - {"method"}


@pytest.mark.parametrize("method", INTEGRATORS)
def test_steps_and_jacobians_are_what_is_declared(method):
    declared, counts = INTEGRATORS[method], None
    for options in ({}, {"step": 1e-2}):
        try:
            counts = fm.simulate(pendulum(), 0.1, method, samples=2, **options).statistics
        except ValueError:
            continue
        assert declared.fixed == ("step" in options)
    assert counts is not None
    assert (counts.jacobians > 0) == (counts.factorisations > 0) == declared.linearises
    assert counts.evaluations >= declared.evaluations * counts.accepted_steps


def test_a_name_that_there_is_not_is_refused():
    with pytest.raises(ValueError, match="method is 'euler': use one of 'dop853', 'rk4'"):
        integrator("euler")


def test_an_argument_that_there_is_not_is_refused_with_those_that_there_are():
    with pytest.raises(TypeError, match="'rtoll': settings of a run are rtol, atol, step, max_steps, spectral_radius"):
        fm.simulate(pendulum(), 0.1, rtoll=1e-6)
