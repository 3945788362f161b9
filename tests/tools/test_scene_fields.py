"""The tables of fields in the manual of scenes are those of the models, and each model has one."""

import re
from typing import Annotated, Literal

import scene_fields
from pydantic import Field

from warpsph.scene.fields import Part, Positive

TEXT = scene_fields.MANUAL.read_text(encoding="utf-8")


def test_the_manual_is_as_the_models_have_it():
    assert scene_fields.renewed(TEXT) == TEXT, "python tools/scene_fields.py makes the tables anew"


def test_each_model_has_one_table():
    named = re.findall(r"<!-- fields of (\w+) -->", TEXT)
    assert sorted(named) == sorted(scene_fields.models())


def test_a_table_tells_what_a_field_is():
    class Pump(Part):
        kind: Literal["gear", "screw"] = Field(
            "gear", description="How it works [-]: gear, or a screw; not a gear_box."
        )
        speed: Positive = Field(description="Speed of the shaft [rad/s], from side [a, b].")
        share: Annotated[float, Field(ge=0, le=0.5)] | None = Field(None, description="Share of it [-].")
        filling: Annotated[float, Field(gt=0, le=1)] = Field(0.5, description="Filling [-].")

    assert scene_fields.table(Pump).splitlines()[2:] == [
        "| `kind` | | `gear` | How it works: `gear`, or a `screw`; not a `gear_box`. |",
        "| `speed` | rad/s | needed | Speed of the shaft, from side [a, b]. |",
        "| `share` | | none | Share of it. |",
        "| `filling` | | 0.5 | Filling. More than 0, at most 1. |",
    ]


def test_an_old_manual_is_told(tmp_path, monkeypatch, capsys):
    file = tmp_path / "README.md"
    file.write_text("# Before\n<!-- fields of View -->\nold\n<!-- end -->\nafter\n")
    monkeypatch.setattr(scene_fields, "MANUAL", file)
    assert scene_fields.main(["--check"]) == 1 and "are old" in capsys.readouterr().out
    assert scene_fields.main([]) == 0 and scene_fields.main(["--check"]) == 0
    written = file.read_text()
    assert written.startswith("# Before\n") and "| `x` | m | none |" in written and "old\n" not in written
