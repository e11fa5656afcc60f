"""Every citation in code and tests is of a document in this repository, at a heading that exists.

One format: `docs/methods/fusion.md#slip-row`. What is cited by number alone, from a document that a
reader does not have, is found by its looks.
"""

from __future__ import annotations

import io
import re
import tokenize
from collections.abc import Iterator
from functools import cache
from pathlib import Path

from support.drives import ROOT

from roadlog import estimators

CITATION = re.compile(r"\bdocs/[\w/]+\.md(?:#([\w-]+))?")
HEADING = re.compile(r"^#+ +(.*?) *$", re.MULTILINE)
CODE = re.compile(r"^```.*?^```", re.MULTILINE | re.DOTALL)
REQUIREMENT = "a requirement's number"  # of an acceptance list; benchmarks number their own rows
UNRESOLVED = {
    "a chapter": re.compile(r"\bchapter", re.IGNORECASE),
    "a section by its number": re.compile(r"\bsections? +\d", re.IGNORECASE),
    "an equation of another document": re.compile(r"\((?:S|C|F|M|K|L|R|W)\d+\)"),
    "an erratum by its number": re.compile(r"(?<!#)\berrat(?:um|a)\b", re.IGNORECASE),
    REQUIREMENT: re.compile(r"(?<![\w/.-])[TAB]\d{1,2}(?![\w/.-])(?= ?[,:;)]| and\b| to\b)"),
    "a number of a section": re.compile(
        r"(?:[;(]|^#) ?[1-9]\.\d{1,2}(?:\.\d+)?[ab]?(?: \([a-e, ]+\))?\)?[\"']?\.?$"
    ),
}


def sources() -> list[Path]:
    folders = ("roadlog", "tests", "benchmarks")
    return [p for folder in folders for p in sorted((ROOT / folder).rglob("*.py")) if p != HERE]


HERE = Path(__file__)


def words(path: Path) -> Iterator[tuple[int, str]]:
    """Lines of comments and texts, and names, with their numbers."""
    with tokenize.open(path) as file:
        tokens = tokenize.generate_tokens(io.StringIO(file.read()).readline)
        for token in tokens:
            if token.type in (tokenize.COMMENT, tokenize.STRING):
                for k, line in enumerate(token.string.splitlines()):
                    yield token.start[0] + k, line.strip()
            elif token.type == tokenize.NAME and "_" in token.string:
                yield token.start[0], token.string.replace("_", " ")


@cache
def anchors(page: Path) -> set[str]:
    """Of the headings, as mkdocs and the forges name them."""
    text = CODE.sub("", page.read_text(encoding="utf-8"))
    plain = (re.sub(r"\[([^]]*)\]\([^)]*\)", r"\1", heading) for heading in HEADING.findall(text))
    return {re.sub(r"[^\w\- ]", "", heading).strip().lower().replace(" ", "-") for heading in plain}


def broken(text: str) -> list[str]:
    """The citations of a text that lead nowhere."""
    result = []
    for found in CITATION.finditer(text):
        page = ROOT / found[0].partition("#")[0]
        if not page.is_file() or (found[1] and found[1] not in anchors(page)):
            result.append(found[0])
    return result


def test_every_citation_resolves() -> None:
    lost = [
        f"{path.relative_to(ROOT)}:{number}: {citation}"
        for path in sources()
        for number, line in words(path)
        for citation in broken(line)
    ]
    assert not lost, "\n".join(lost)


def test_nothing_is_cited_that_is_not_here() -> None:
    lost = [
        f"{path.relative_to(ROOT)}:{number}: {kind}: {line}"
        for path in sources()
        for number, line in words(path)
        for kind, pattern in UNRESOLVED.items()
        if pattern.search(line) and not (kind == REQUIREMENT and "tests" not in path.parts)
    ]
    assert not lost, "\n".join(lost)


def test_every_estimator_cites_its_method() -> None:
    for estimator in estimators.all_estimators():
        assert CITATION.search(estimator.reference), estimator.name
        assert not broken(estimator.reference), estimator.reference


def test_a_citation_that_leads_nowhere_is_found() -> None:
    assert broken("docs/methods/fusion.md#slip-row") == []
    assert broken("docs/methods/fusion.md#no-such-row") == ["docs/methods/fusion.md#no-such-row"]
    assert broken("see docs/nowhere.md") == ["docs/nowhere.md"]
