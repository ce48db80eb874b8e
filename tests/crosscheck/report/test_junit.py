"""junit.xml: valid for the readers of such files, with figures, versions, machine and times."""

import re
from pathlib import Path
from xml.etree import ElementTree

import pytest

from crosscheck.report import UNFINISHED
from crosscheck.report.junit import write_junit
from tests.crosscheck.report.sessions import session
from tests.crosscheck.sessions import versus

# The elements and attributes of the strictest common schema, that of Jenkins' xunit plug-in (junit-10.xsd): those that
# it demands, and all that it takes. Other readers take these, and more.
ATTRIBUTES = {
    "testsuites": (set(), {"name", "time", "tests", "failures", "errors"}),
    "testsuite": (
        {"name", "tests", "failures", "errors"},
        {"name", "tests", "failures", "errors", "skipped", "time", "timestamp", "hostname", "id", "package", "file"},
    ),
    "properties": (set(), set()),
    "property": ({"name", "value"}, {"name", "value"}),
    "testcase": ({"name"}, {"name", "classname", "time", "group"}),
    "failure": (set(), {"type", "message"}),
    "skipped": (set(), {"type", "message"}),
    "system-out": (set(), set()),
}
CHILDREN = {
    "testsuites": {"testsuite"}, "testsuite": {"properties", "testcase"}, "properties": {"property"},
    "testcase": {"failure", "skipped", "system-out"},
}  # fmt: skip
TIME = re.compile(r"(([0-9]{0,3},)*[0-9]{3}|[0-9]{0,3})*(\.[0-9]*)?")
MIXED = versus("fine", "stepper", "absent", "diverger", goals='"marker:tip.position" = 1e-6, "load" = 1e-6')


def faults(root: ElementTree.Element) -> list[str]:
    """What a reader might refuse."""
    found = [] if root.tag == "testsuites" else [f"root {root.tag}"]
    for element in root.iter():
        required, known = ATTRIBUTES.get(element.tag, (set(), set()))
        found += [f"{element.tag} without {name}" for name in required - set(element.attrib)]
        found += [f"{element.tag} with {name}" for name in set(element.attrib) - known]
        found += [f"{each.tag} in {element.tag}" for each in element if each.tag not in CHILDREN.get(element.tag, ())]
        if not TIME.fullmatch(element.get("time", "0")):
            found.append(f"time {element.get('time')}")
    for suite in root:
        tests = suite.findall("testcase")
        counts = {"tests": len(tests), "errors": 0, "failures": sum(test.find("failure") is not None for test in tests)}
        counts["skipped"] = sum(test.find("skipped") is not None for test in tests)
        found += [f"{key} {suite.get(key)}" for key, count in counts.items() if int(suite.get(key, "0")) != count]
        if suite.find("properties") is not None and suite[0].tag != "properties":
            found.append("properties behind tests")
    return found


@pytest.fixture(scope="module")
def mixed(tmp_path_factory: pytest.TempPathFactory) -> ElementTree.Element:
    folder = tmp_path_factory.mktemp("mixed")
    session(folder, MIXED)
    return ElementTree.parse(folder / "junit.xml").getroot()


def test_it_is_valid(mixed: ElementTree.Element, tmp_path: Path) -> None:
    assert faults(mixed) == []
    assert mixed.find(".//failure") is not None and mixed.find(".//skipped") is not None
    write_junit(UNFINISHED, tmp_path / "junit.xml")
    assert faults(ElementTree.parse(tmp_path / "junit.xml").getroot()) == []


@pytest.mark.parametrize(
    ("path", "name", "value"), [(".", "skipped", "0"), ("testsuite", "failures", "99"), (".//testcase", "time", "1e-3")]
)
def test_what_is_invalid_is_found(mixed: ElementTree.Element, path: str, name: str, value: str) -> None:
    root = ElementTree.fromstring(ElementTree.tostring(mixed))
    element = root if path == "." else root.find(path)
    assert element is not None
    element.set(name, value)
    assert faults(root)


def test_machine_and_versions_are_properties_of_a_suite(mixed: ElementTree.Element) -> None:
    found = {each.get("name"): each.get("value") for each in mixed.findall("testsuite/properties/property")}
    assert found["engine fine"] == "1.0" and {"machine", "system", "python", "version of flexmb"} <= set(found)
    assert "engine absent" not in found


def test_figures_are_in_the_output_of_a_test(mixed: ElementTree.Element) -> None:
    (test,) = mixed.findall(".//testcase[@name='all: marker:tip.position, fine – stepper']")
    told = dict(re.findall(r"\[\[PROPERTY\|(\w+)=(.+)\]\]", test.findtext("system-out", "")))
    assert 0.0 <= float(told["E"]) <= float(told["U"]) <= float(told["goal"]) == 1e-6
    assert told["status"] == told["expected"] == "agree"


def test_times_of_tests_add_up_to_those_of_the_runs(mixed: ElementTree.Element) -> None:
    (suite,) = mixed
    times = [float(test.get("time", "0")) for test in suite.findall("testcase")]
    assert sum(times) == pytest.approx(float(suite.get("time", "0")), abs=1e-3 * len(times))
    assert float(suite.get("time", "0")) > 0.5, "the stepper claims 2e-3 s divided by its step for each solve"
