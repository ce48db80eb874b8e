"""The generated documents are those of the schema as it is."""

import json
from pathlib import Path

from flexmb.scene import reference
from flexmb.scene import schema as s

DOCS = Path(__file__).resolve().parents[3] / "docs"
REMEDY = "run: python -m flexmb.scene.reference"


def test_documents_are_up_to_date(tmp_path):
    reference.write(tmp_path)
    for name in ("scene.schema.json", "scene-reference.md"):
        assert (tmp_path / name).read_text(encoding="utf-8") == (DOCS / name).read_text(encoding="utf-8"), REMEDY


def test_every_struct_has_a_section_and_links_lead_to_one():
    text = reference.reference()
    for name in s.__all__:
        if hasattr(getattr(s, name), "__struct_fields__"):
            assert f"## {name}" in text
    headings = {line[3:].lower().replace("`", "").translate(str.maketrans("", "", '()="')).replace(" ", "-")
                for line in text.splitlines() if line.startswith("## ")}  # fmt: skip
    links = {part.split(")")[0] for part in text.split("](#")[1:]}
    assert links <= headings


def test_units_and_ranges_are_read_from_the_keys_and_their_types():
    text = reference.reference()
    assert '| `stiffness_Nm_rad` | number | N m/rad | ≥ 0, else doubtful ("negative_stiffness") | `0.0` |' in text
    assert "| `mass_per_length_kg_m` | number | kg/m | > 0 | none |" in text
    assert "| `rotary_y_kg_m` | number | kg m | ≥ 0 | `0.0` |" in text
    assert "| `restitution` | number | 1 | 0 to 1 | `1.0` |" in text
    schemas = json.loads(reference.json_schema())["$defs"]
    restitution, mass = schemas["Impact"]["properties"]["restitution"], schemas["TipMass"]["properties"]["mass_kg"]
    assert (restitution["minimum"], restitution["maximum"], mass["exclusiveMinimum"]) == (0.0, 1.0, 0.0)
    assert "minimum" not in schemas["LinearCoordinate"]["properties"]["stiffness_N_m"]  # it is only doubtful
