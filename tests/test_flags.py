"""The bits of `flags` are the same in vocabulary, schema and documentation."""

from __future__ import annotations

import re

from support.drives import ROOT

from roadlog.signals import FLAGS

# where the comment has another word than the name
SAID = {"uncertain": "uncertainty", "powertrain": "gear or torque"}


def test_the_documentation_names_every_flag_by_its_bit() -> None:
    text = (ROOT / "docs" / "conventions.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| (\d+) \| `(\w+)` \|", text, flags=re.MULTILINE)
    assert {name: int(bit) for bit, name in rows} == FLAGS


def test_the_schema_explains_every_bit() -> None:
    text = (ROOT / "schemas" / "roadlog" / "v1" / "road_angles.proto").read_text(encoding="utf-8")
    (comment,) = re.findall(r"flags = \d+;\s*// bits: (.*)", text)
    explained = dict(re.findall(r"(\d+) ([^,]+)", comment))
    assert [int(bit) for bit in explained] == sorted(FLAGS.values())
    for name, bit in FLAGS.items():
        words = SAID.get(name, name)
        assert words in explained[str(bit)], (name, bit)
