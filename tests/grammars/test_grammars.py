"""The schemas against the front end, against each other, and against their documentation."""

from __future__ import annotations

import io
import re
from functools import cache
from typing import TYPE_CHECKING

import pytest
import rnc2rng
from hypothesis import given, settings
from lxml import etree

from gpsfsm.analysis.rules import all_rules
from gpsfsm.errors import UsageError
from gpsfsm.grammars import SCHEMAS, relax_ng, relax_ng_compact, schema_path, xsd
from gpsfsm.model.finding import Severity
from gpsfsm.model.plan import ControlType
from gpsfsm.syntax import Limits, parse
from tests.conftest import REPO
from tests.grammars import texts

if TYPE_CHECKING:
    from pathlib import Path

MORE = settings(max_examples=3 * settings.default.max_examples)
DOCS = REPO / "docs" / "grammar.md"


# --- who accepts what ----------------------------------------------------------------------------


@cache
def _relax_ng() -> etree.RelaxNG:
    return etree.RelaxNG(etree.fromstring(relax_ng()))


@cache
def _xsd() -> etree.XMLSchema:
    return etree.XMLSchema(etree.fromstring(xsd()))


@cache
def _errors() -> frozenset[str]:
    """The codes of the rules on plan texts that are errors."""
    return frozenset(
        rule.code
        for rule in all_rules()
        if rule.code.startswith("GP1") and rule.severity is Severity.ERROR
    )


def _tree(text: str) -> etree._ElementTree | None:
    """The text as XML, or None if it is not well-formed or has a DOCTYPE."""
    parser = etree.XMLParser(
        encoding="utf-8",
        resolve_entities=False,
        no_network=True,
        load_dtd=False,
        dtd_validation=False,
        huge_tree=True,
    )
    try:
        tree = etree.ElementTree(etree.fromstring(text.encode(), parser))
    except (etree.XMLSyntaxError, UnicodeEncodeError):
        return None
    # Of several errors in namespaces lxml heeds the last one only, and a later warning hides it.
    if len(parser.error_log.filter_from_errors()) or tree.docinfo.internalDTD is not None:
        return None
    return tree


def _grammar_accepts(text: str) -> bool:
    tree = _tree(text)
    return tree is not None and _relax_ng().validate(tree)


def _xsd_accepts(text: str) -> bool:
    tree = _tree(text)
    return tree is not None and _xsd().validate(tree)


def _front_end_accepts(text: str) -> bool:
    return not any(problem.rule in _errors() for problem in parse(text).problems)


def _verdicts(text: str) -> dict[str, bool]:
    return {
        "grammar": _grammar_accepts(text),
        "xsd": _xsd_accepts(text),
        "front end": _front_end_accepts(text),
    }


def _all(accepted: bool) -> dict[str, bool]:
    return {"grammar": accepted, "xsd": accepted, "front end": accepted}


# --- the same language: properties ---------------------------------------------------------------


@given(texts.plans())
def test_plans_are_accepted(text: str) -> None:
    assert _verdicts(text) == _all(True)


@MORE
@given(texts.spoiled_plans())
def test_one_thing_wrong_is_one_too_many(written: texts.Text) -> None:
    text, spoiled = written
    assert _verdicts(text) == _all(not spoiled)


@given(texts.wild_texts())
def test_same_language_on_wild_texts(written: texts.Text) -> None:
    text, _ = written
    assert _verdicts(text) == _all(_grammar_accepts(text))


@given(texts.mutated_plans())  # tests/campaigns/pairs/grammars.py puts very many more
def test_same_language_on_mutated_plans(text: str) -> None:
    assert _verdicts(text) == _all(_grammar_accepts(text))


def test_same_language_on_real_plans(shared_corpus: Path) -> None:
    paths = sorted(shared_corpus.glob("plans/*.xml"))
    paths += sorted(shared_corpus.glob("experiment1/fabric/**/*.xml"))
    paths += sorted(shared_corpus.glob("experiment2/*.xml"))
    seen = set()
    for path in paths:
        text = path.read_text(encoding="utf-8")
        verdicts = _verdicts(text)
        assert verdicts == _all(verdicts["grammar"]), path
        seen.add(verdicts["grammar"])
    assert seen == {True, False}


def test_same_language_on_our_plans() -> None:
    paths = sorted((REPO / "corpus").rglob("*.xml"))
    verdicts = {path: _verdicts(path.read_bytes().decode("utf-8", "replace")) for path in paths}
    wrong = [path for path, each in verdicts.items() if each != _all(each["grammar"])]
    assert not wrong


# --- the same language: each choice by itself ----------------------------------------------------

RUNNER = '<Runner interface="demo/GoRunner" provider="demo/GoRunner"'


def _around(inside: str) -> tuple[str, str]:
    control = f'<Control type="sequential">{RUNNER}/>{inside}</Control>'
    return f"<Plan>{inside}{RUNNER}/>{inside}</Plan>", f"<Plan>{control}</Plan>"


def _with_attributes(attributes: str) -> tuple[str, str, str]:
    return (
        f"<Plan{attributes}>{RUNNER}/></Plan>",
        f'<Plan><Control type="recovery"{attributes}></Control></Plan>',
        f"<Plan>{RUNNER}{attributes}/></Plan>",
    )


def _with_value(value: str) -> tuple[str, ...]:
    return _with_attributes(f" goal='{value}'")


def _plans() -> list[str]:
    """Texts that are plans."""
    actual = [f"{prolog}<Plan/>" for prolog in texts.PROLOGS]
    actual += [f"{filler}<Plan/>{filler}" for filler in texts.FILLERS]
    actual += [f'<Plan><Control type="{right}"/></Plan>' for right in texts.RIGHT_TYPES]
    for filler in texts.INNER_FILLERS:
        actual += [*_around(filler), f"<Plan>{RUNNER}>{filler}</Runner></Plan>"]
    for value in (*texts.FILLED, *texts.BLANK):
        actual += _with_value(value)
    for value in texts.FILLED:
        actual.append(f"<Plan><Runner interface='{value}' provider='{value}'/></Plan>")
    for name, value in texts.DECLARATIONS:
        actual += _with_attributes(f"{name}='{value}'")
    for name in texts.NAMES:
        if not name.startswith("p:"):
            actual += _with_attributes(f" {name}='1'")
    return actual


def _no_plans() -> list[str]:
    """Texts that are no plans."""
    results = ["", " ", "Plan", "<!-- <Plan/> -->", "<Plan>", "</Plan>", f"{RUNNER}/>", "<Plans/>"]
    results += [f"{prolog}<Plan/>" for prolog in texts.BAD_PROLOGS]
    results += [f"<Plan/>{epilog}" for epilog in texts.BAD_EPILOGS]
    results += [f"<Plan><Control type='{wrong}'/></Plan>" for wrong in texts.WRONG_TYPES]
    for stray in (*texts.STRAY_TEXTS, *texts.STRAY_ELEMENTS):
        results += [*_around(stray), f"<Plan>{RUNNER}>{stray}</Runner></Plan>"]
    for element in texts.ELEMENTS:
        results.append(f"<Plan>{RUNNER}>{element}</Runner></Plan>")
    for value in texts.NOT_VALUES:
        results += _with_value(value)
    for value in (*texts.BLANK, *texts.NOT_VALUES):
        results.append(f"<Plan><Runner interface='{value}' provider='demo/GoRunner'/></Plan>")
        results.append(f"<Plan><Runner interface='demo/GoRunner' provider='{value}'/></Plan>")
    for bad in texts.BAD_ATTRIBUTES:
        results += _with_attributes(bad)
    for name in texts.BAD_NAMES:
        if name != "Runner":
            results.append(f"<Plan><{name} interface='a' provider='b'></{name}></Plan>")
        if name != "Plan":
            results.append(f"<{name}></{name}>")
    return results


@pytest.mark.parametrize("text", _plans(), ids=ascii)
def test_plan(text: str) -> None:
    assert _verdicts(text) == _all(True)


@pytest.mark.parametrize("text", _no_plans(), ids=ascii)
def test_no_plan(text: str) -> None:
    assert _verdicts(text) == _all(False)


# --- the schemas themselves ----------------------------------------------------------------------


def _canonical(schema: bytes) -> bytes:
    """The schema in a normal form, without comments and without white space between elements."""
    parser = etree.XMLParser(remove_blank_text=True, remove_comments=True)
    tree = etree.fromstring(schema, parser)
    etree.cleanup_namespaces(tree)
    out = io.BytesIO()
    etree.ElementTree(tree).write_c14n(out)
    return out.getvalue()


def test_both_forms_of_relax_ng_are_one_schema() -> None:
    converted = rnc2rng.dumps(rnc2rng.loads(relax_ng_compact())).encode()
    assert _canonical(converted) == _canonical(relax_ng())


@pytest.mark.parametrize("name", [*SCHEMAS, "rnc", "rng", "xsd"])
def test_schema_path(name: str) -> None:
    path = schema_path(name)
    assert path.is_file()
    assert path.name.endswith(name)


@pytest.mark.parametrize("name", ["", "dtd", ".rng", "../gpsfsm-plan.rng", "plan.rng", "RNG"])
def test_unknown_schema(name: str) -> None:
    with pytest.raises(UsageError, match=r"the schemas are gpsfsm-plan\.rnc, gpsfsm-plan\.rng, "):
        schema_path(name)


def test_every_schema_file_has_a_name() -> None:
    folder = schema_path("rng").parent
    files = {path.name for ending in ("rnc", "rng", "xsd") for path in folder.glob(f"*.{ending}")}
    assert files == set(SCHEMAS)


def test_schemas_name_the_types_of_control() -> None:
    types = {kind.value for kind in ControlType}
    relax = etree.fromstring(relax_ng()).iter("{http://relaxng.org/ns/structure/1.0}value")
    schema = etree.fromstring(xsd()).iter("{http://www.w3.org/2001/XMLSchema}enumeration")
    assert {value.text for value in relax} == types
    assert {value.get("value") for value in schema} == types


@pytest.mark.parametrize(
    ("attribute", "accepted_by_xsd"),
    [
        ("xsi:schemaLocation='urn:p plan.xsd'", True),
        ("xsi:noNamespaceSchemaLocation='gpsfsm-plan.xsd'", True),
        ("xsi:type='Plan'", True),
        ("xsi:type='Runner'", False),
        ("xsi:type='unknown'", False),
        ("xsi:nil='true'", False),
    ],
)
def test_xsd_obeys_its_own_attributes(attribute: str, accepted_by_xsd: bool) -> None:
    text = f"<Plan xmlns:xsi='http://www.w3.org/2001/XMLSchema-instance' {attribute}/>"
    expected = {"grammar": True, "xsd": accepted_by_xsd, "front end": True}
    assert _verdicts(text) == expected


def test_large_plan_is_validated_in_time() -> None:
    count = 20_000
    runner = f"{RUNNER} x='1' y='2'/>"
    for inside in (runner * count, f'<Control type="recovery">{runner}</Control>' * count):
        assert _grammar_accepts(f"<Plan>{inside}</Plan>")
        assert not _grammar_accepts(f"<Plan>{inside}<Runner/></Plan>")
    deep = '<Control type="sequential">' * 199 + "</Control>" * 199
    assert _verdicts(f"<Plan>{deep}</Plan>") == _all(True)


# --- the documentation ---------------------------------------------------------------------------


def _fenced(language: str) -> list[str]:
    matches = re.findall(
        rf"^```{language}\n(.*?)^```$", DOCS.read_text(encoding="utf-8"), re.M | re.S
    )
    assert matches, f"no {language} example in {DOCS.name}"
    return matches


def test_examples_of_the_docs_are_plans() -> None:
    for text in _fenced("xml"):
        assert _verdicts(text) == _all(True), text


def test_docs_give_the_limits() -> None:
    words = DOCS.read_text(encoding="utf-8")
    limits = Limits()
    rows = dict(re.findall(r"^\| `--(max-[a-z-]+)` \| ([0-9,]+) \|", words, re.M))
    for name in ("bytes", "depth", "elements", "attributes", "attribute_length"):
        written = rows[f"max-{name.replace('_', '-')}"].replace(",", "")
        assert int(written) == getattr(limits, f"max_{name}")


def test_ebnf_names_what_it_uses() -> None:
    (ebnf,) = _fenced("ebnf")
    ebnf = re.sub(r"/\*.*?\*/", "", ebnf, flags=re.S)
    defined = re.findall(r"^([A-Za-z-]+)\s*::=", ebnf, re.M)
    of_xml = {"XMLDecl", "Misc", "S", "Name", "Eq", "AttValue", "Comment", "PI", "CharRef"}
    used = set(
        re.findall(r"[A-Za-z][A-Za-z-]*", re.sub(r"'[^']*'|\"[^\"]*\"|#x[0-9A-F]+", "", ebnf))
    )
    assert len(defined) == len(set(defined))
    assert used == set(defined) | of_xml
    for kind in ControlType:
        assert f"'{kind.value}'" in ebnf
