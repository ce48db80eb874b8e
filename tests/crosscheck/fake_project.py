"""A project as an outsider has it: a case with its stored reference, and a distribution whose plug-ins are engines."""

from pathlib import Path

from tests.crosscheck.sessions import referenced

NAMES = ("fine", "stepper", "biased", "absent", "refuser", "raiser", "diverger", "diarist")
RUN_FILE = """
tags = ["small", "skip"]

[[variant]]
name = "rigid"
engines = ["fine", "stepper"]

[[comparison]]
name = "all"
variant = "rigid"
goals = { "marker:tip.position" = 1e-6, "load" = 1e-6, "energy.total" = 1e-6 }

[[conservation]]
variant = "rigid"
quantity = "energy"
limit = 1e-8

[reference]
variant = "rigid"
samples = 11

[[reference.route]]
engine = "fine"

[[reference.route]]
engine = "stepper"
"""


def fake_project(folder: Path) -> Path:
    """Put the small case, as pendulum/single, and the fake engines into a folder, which is returned."""
    referenced(folder, RUN_FILE)
    makers = [f"def {name}(): return engines()[{name!r}]" for name in NAMES]
    text = "\n".join(["from tests.crosscheck.fake_engines import engines", *makers, ""])
    (folder / "fake_plug_ins.py").write_text(text, encoding="utf-8")
    info = folder / "fake_plug_ins-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: fake-plug-ins\nVersion: 1.0\n", encoding="utf-8")
    lines = [f"{name} = fake_plug_ins:{name}" for name in NAMES]
    (info / "entry_points.txt").write_text("\n".join(["[crosscheck.engines]", *lines, ""]), encoding="utf-8")
    return folder
