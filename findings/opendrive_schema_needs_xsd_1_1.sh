#!/usr/bin/env bash
# The schema of ASAM OpenDRIVE 1.8.0 cannot be loaded by lxml, the usual validator of Python.
#
# OpenDRIVE 1.7's schema files load in lxml. Those of 1.8.0 use XML Schema 1.1, which libxml2 (and so
# lxml) does not know: it does not say so, but calls the content of an extension not valid, as if the
# official schema were broken. A validator of XSD 1.1 (xmlschema's XMLSchema11) loads them.
# Packages: lxml 6.1.3, xmlschema 4.3.2; the schema files as asam-qc-opendrive 1.0.0 ships them.
# Why it matters: a road out of drive logs has to be checked before a simulator takes it, and the check
# that worked for 1.7 fails for every file of 1.8, good or bad.
set -euo pipefail
folder=$(mktemp -d); trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet "lxml==6.1.3" "xmlschema==4.3.2"
"$folder/venv/bin/pip" download --quiet --no-deps --dest "$folder" "asam-qc-opendrive==1.0.0"
"$folder/venv/bin/python" - "$folder" <<'PYTHON'
import sys
import zipfile
from importlib.metadata import version
from pathlib import Path

import xmlschema
from lxml import etree

folder = Path(sys.argv[1])
for name in ("lxml", "xmlschema"):
    print(name, version(name))
zipfile.ZipFile(next(folder.glob("*.whl"))).extractall(folder / "wheel")
core = {v: next((folder / "wheel").rglob(f"schema/{v}/*ore.xsd")) for v in ("1.7.0", "1.8.0")}


def loads(path: Path) -> str:
    try:
        etree.XMLSchema(etree.parse(str(path)))
    except etree.XMLSchemaParseError as error:
        return str(error)[:160]
    return ""


said = {release: loads(path) for release, path in core.items()}
for release, text in said.items():
    print(f"lxml, OpenDRIVE {release}: {text or 'loads'}")
assert not said["1.7.0"], "changed: lxml does not load the schema of 1.7"
assert said["1.8.0"], "changed: lxml loads the schema of 1.8"
xmlschema.XMLSchema11(str(core["1.8.0"]))
print("xmlschema.XMLSchema11, OpenDRIVE 1.8.0: loads")
print("as described")
PYTHON
