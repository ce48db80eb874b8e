"""The generated documents are those of the schema as it is."""

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


def test_units_are_read_from_the_keys():
    text = reference.reference()
    assert "| `stiffness_Nm_rad` | number | N m/rad | `0.0` |" in text
    assert "| `mass_per_length_kg_m` | number | kg/m | none |" in text
    assert "| `rotary_y_kg_m` | number | kg m | `0.0` |" in text
