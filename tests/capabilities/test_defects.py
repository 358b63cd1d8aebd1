"""One golden message per thing that can be wrong with a file."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from gpsfsm.capabilities.defects import Notes, errors_text
from gpsfsm.model.capability import Outcomes, ValueType
from tests.capabilities.support import INTERFACE, PROVIDER, load, provider, said

if TYPE_CHECKING:
    from pathlib import Path

PARAMETERS = "definition:\n  configuration_parameters:\n"
DESCRIBED = (
    PARAMETERS + "    - {name: speed, type: double, default: 1}\n    - {name: mode, type: string}\n"
)
"""Lines 5 to 8."""
RUNTIME = "definition:\n  runtime_parameters:\n"

CASES = {
    "type": (
        PARAMETERS + "    - {name: a, type: dubble}\n",
        "7:17: error: 'dubble' is not a type, so any value is taken\n    did you mean 'double'?",
    ),
    "type_unlike_any": (
        PARAMETERS + "    - {name: a, type: geometry}\n",
        "7:17: error: 'geometry' is not a type, so any value is taken\n"
        "    the types are string, bool, int, double, and lists such as string[]",
    ),
    "default": (
        PARAMETERS + "    - {name: a, type: int, default: 1.5}\n",
        "7:28: error: the default of 'a' is not of type int\n    change the type or the default",
    ),
    "default_not_finite": (
        PARAMETERS + "    - {name: a, type: double, default: .inf}\n",
        "7:31: error: the default of 'a' is not of type double\n    change the type or the default",
    ),
    "default_mapping": (
        PARAMETERS + "    - {name: a, default: {b: 1}}\n",
        "7:17: error: the default of 'a' is not a single finite value\n"
        "    change the type or the default",
    ),
    "default_out_of_bounds": (
        PARAMETERS + "    - {name: a, type: double, default: 9, maximum: 3}\n",
        "7:31: error: the default 9 is greater than the maximum\n    change one",
    ),
    "default_below": (
        PARAMETERS + "    - {name: a, type: double, default: 1, minimum: 3}\n",
        "7:31: error: the default 1 is less than the minimum\n    change one",
    ),
    "default_no_choice": (
        PARAMETERS + "    - {name: a, type: string, default: c, choices: [a, b]}\n",
        "7:31: error: the default of 'a' is not among its choices\n    they are 'a', 'b'",
    ),
    "bounds": (
        PARAMETERS + "    - {name: a, type: double, minimum: 4, maximum: 3}\n",
        "7:31: error: the minimum 4 is greater than the maximum 3\n"
        "    no value fits; change one of them",
    ),
    "bounds_of_text": (
        PARAMETERS + "    - {name: a, type: string, minimum: 4}\n",
        "7:31: error: 'minimum' is for numbers, and 'a' is a string\n"
        "    remove it or change the type",
    ),
    "bound_no_number": (
        PARAMETERS + "    - {name: a, minimum: low}\n",
        "7:17: error: 'definition.configuration_parameters[1].minimum' must be a finite number, "
        "not 'low'",
    ),
    "flag": (
        PARAMETERS + "    - {name: a, optional: maybe}\n",
        "7:17: error: 'definition.configuration_parameters[1].optional' must be true or false, "
        "not 'maybe'",
    ),
    "text": (
        PARAMETERS + "    - {name: a, description: [b]}\n",
        "7:17: error: 'definition.configuration_parameters[1].description' must be a text, "
        "not a list",
    ),
    "list": (
        "resources: base\n",
        "5:1: error: 'resources' must be a list, not 'base'",
    ),
    "mapping": (
        "duration: 5\n",
        "5:1: error: 'duration' must be a mapping ('key: value' lines), not '5'",
    ),
    "no_name": (
        PARAMETERS + "    - type: int\n",
        "7:7: error: 'definition.configuration_parameters[1]' has no 'name'\n    add it",
    ),
    "required_and_optional": (
        PARAMETERS + "    - {name: a, required: true, optional: true}\n",
        "7:33: error: 'a' is both required and optional\n"
        "    remove one of the two; it is taken as optional",
    ),
    "twice": (
        PARAMETERS + "    - name: a\n    - name: a\n",
        "8:7: error: the parameter 'a' is described twice\n    remove one of them",
    ),
    "alias": (
        PARAMETERS + "    - {name: a, aliases: [b]}\n    - {name: b}\n",
        "7:17: error: the alias 'b' is also another name here\n"
        "    remove it; a name can mean one thing only",
    ),
    "label": (
        PARAMETERS + "    - name: id\n",
        "7:7: warning: a plan cannot give a parameter named 'id'\n    give it another name",
    ),
    "no_attribute": (
        PARAMETERS + "    - name: two words\n",
        "7:7: warning: a plan cannot give a parameter named 'two words'\n    give it another name",
    ),
    "fallback": (
        DESCRIBED + "  runtime_parameters:\n    input: [{name: x, fallback_parameter: speeed}]\n",
        "10:23: error: there is no configuration parameter 'speeed' to fall back to\n"
        "    did you mean 'speed'?",
    ),
    "source": (
        RUNTIME + "    input: [{name: x, satisfiable_from: [upstrem]}]\n",
        "7:23: error: an input cannot be satisfied from 'upstrem'\n    did you mean 'upstream'?",
    ),
    "on": (
        RUNTIME + "    output: [{name: x, on: never}]\n",
        "7:24: error: 'never' is nothing that an output can be handed over on\n"
        "    write success, failure or both",
    ),
    "output_twice": (
        RUNTIME + "    output: [{name: x}, {name: x, on: success}]\n",
        "7:26: error: the output 'x' is described twice for one event\n    remove one of them",
    ),
    "command": (
        DESCRIBED + "  command: \"<Runner speed='$speed' mod='a'/>\"\n",
        "9:3: warning: the command gives a parameter 'mod' that is not described\n"
        "    did you mean 'mode'?",
    ),
    "contradiction": (
        "outcomes: {never_fails: true, never_succeeds: true}\n",
        "5:12: error: 'never_fails' and 'never_succeeds' cannot both be true\n"
        "    remove one of them; never_fails is not used",
    ),
    "unless_of_nothing": (
        DESCRIBED + "outcomes: {unless: {speed: 1}}\n",
        "9:12: warning: 'unless' says when 'never_fails' does not hold, which is not declared\n"
        "    add 'never_fails: true', or remove it",
    ),
    "unless_unknown": (
        DESCRIBED + "outcomes: {never_fails: true, unless: {spede: 1}}\n",
        "9:40: error: there is no configuration parameter 'spede'\n    did you mean 'speed'?",
    ),
    "unless_never": (
        DESCRIBED + "outcomes: {never_fails: true, unless: {speed: fast}}\n",
        "9:40: error: 'speed' never has this value: it is not a double\n"
        "    write a value of the type of the parameter",
    ),
    "span": (
        "duration: {min: 5, max: 2}\n",
        "5:12: error: min is greater than max: 5 and 2\n    change one of them",
    ),
    "negative": (
        "energy: {min: -1}\n",
        "5:10: error: min is negative: -1\n    write 0 or more",
    ),
    "span_too_long": (
        "duration: {min: 1, max: 1.0e+13}\n",
        "5:20: error: max is greater than 1e+12: 1e+13\n"
        "    write a smaller number, or leave max out",
    ),
    "span_too_much": (
        "energy: {min: 2000000000000}\n",
        "5:10: error: min is greater than 1e+12: 2e+12\n    write a smaller number",
    ),
    "span_unknown": (
        DESCRIBED + "duration: {max: timeout}\n",
        "9:12: error: there is no configuration parameter 'timeout'\n    there are 'speed', 'mode'",
    ),
    "span_no_number": (
        DESCRIBED + "duration: {max: mode}\n",
        "9:12: error: 'mode' is a string and not a number\n"
        "    name a parameter of type double or int",
    ),
    "span_not_finite": (
        "duration: {max: .nan}\n",
        "5:12: error: 'duration.max' must be a number or the name of a parameter, not '.nan'",
    ),
    "buffer": (
        DESCRIBED + "effects: {prompt_buffer: {uuid: mode, flush: flash}}\n",
        "9:39: error: there is no configuration parameter 'flash'\n    there are 'speed', 'mode'",
    ),
    "buffer_incomplete": (
        DESCRIBED + "effects: {prompt_buffer: {uuid: mode}}\n",
        "9:11: error: 'effects.prompt_buffer' has no 'flush'\n    add it",
    ),
    "answer": (
        DESCRIBED + "effects: {prompt_buffer: {uuid: mode, flush: speed, answer: x}}\n",
        "9:53: error: there is no output 'x'\n    describe it",
    ),
    "sets_plan": (
        RUNTIME + "    input: [name: plan]\neffects: {sets_plan: plans}\n",
        "8:11: error: there is no input 'plans'\n    did you mean 'plan'?",
    ),
    "effect_answers": (
        RUNTIME + "    output: [name: text]\neffects: {answers: test}\n",
        "8:11: error: there is no output 'test'\n    did you mean 'text'?",
    ),
    "effect_question": (
        DESCRIBED + "effects: {question: made}\n",
        "9:11: error: there is no configuration parameter 'made'\n    did you mean 'mode'?",
    ),
    "effect_checks": (
        DESCRIBED + "effects: {checks: made}\n",
        "9:11: error: there is no configuration parameter 'made'\n    did you mean 'mode'?",
    ),
    "unknown_key": (
        "resource: [base]\n",
        "5:1: error: the key 'resource' is not known here\n    did you mean 'resources'?",
    ),
    "unknown_key_of_others": (
        "idempotent: true\n",
        "5:1: warning: the key 'idempotent' is not known here\n    did you mean 'implements'?",
    ),
    "key_of_another_level": (
        DESCRIBED + "minimum: 3\n",
        "9:1: error: the key 'minimum' is not known here\n"
        "    it belongs to an entry of 'configuration_parameters'",
    ),
    "key_of_the_level_above": (
        "definition: {resources: [arm]}\n",
        "5:14: error: the key 'resources' is not known here\n    it belongs to a provider",
    ),
    "key_of_the_level_beside": (
        "definition: {configuration_parameters: [{name: x, max: 3}]}\n",
        "5:51: error: the key 'max' is not known here\n    it belongs to 'duration' or 'energy'",
    ),
    "unknown_inner_key": (
        RUNTIME + "    output: [{name: a, unit: m}]\n",
        "7:24: warning: the key 'unit' is not known here\n    it is ignored",
    ),
    "depends_interface": (
        "depends_on:\n  arm/Grasb: {}\n",
        "6:3: warning: it depends on 'arm/Grasb', which no file describes\n"
        "    did you mean 'arm/Grasp'?",
    ),
    "depends_provider": (
        "depends_on:\n  arm/Grasp: {provider: arm/Other}\n",
        "6:3: warning: it depends on the provider 'arm/Other', which no file describes\n"
        "    describe it, or load its files as well",
    ),
}


@pytest.mark.parametrize("case", CASES)
def test_defects_of_a_provider(tmp_path: Path, case: str) -> None:
    body, expected = CASES[case]
    loaded, texts = provider(tmp_path, body)
    assert texts == [expected]
    assert len(loaded.library.providers) == 1, "the rest of the file is used"


INTERFACE_CASES = {
    "default_unknown": (
        INTERFACE + "default_provider: arm/Grip\n",
        "4:1: warning: the default provider 'arm/Grip' is described by no file\n"
        "    did you mean 'arm/Grasp'?",
    ),
    "default_of_another": (
        INTERFACE + "default_provider: arm/Other\n",
        "4:1: warning: the default provider 'arm/Other' implements 'arm/Lift'\n"
        "    name a provider that implements 'arm/Grasp'",
    ),
    "newer": (
        "name: Grasp\nspec_type: interface\nspec_version: 1.10\n",
        "3:1: warning: spec_version 1.10 is newer than 1.2, the newest that is known here\n"
        "    what is new in it is not understood",
    ),
    "no_version": (
        "name: Grasp\nspec_type: interface\nspec_version: new\n",
        "3:1: warning: 'new' is not a spec_version\n    the versions are 1, 1.1 and 1.2",
    ),
    "other_name": (
        "name: Grab\nspec_type: interface\n",
        "1:1: warning: the name is 'Grab', but the file is called 'Grasp'\n"
        "    the name 'Grab' is used; rename one",
    ),
    "other_package": (
        "name: leg/Grasp\nspec_type: interface\n",
        "1:1: warning: the package is 'leg', but the file is in 'arm'\n"
        "    'leg' is used; change one",
    ),
    "bad_name": (
        'name: "a b"\nspec_type: interface\n',
        "1:1: error: 'a b' cannot be the name of a capability\n"
        "    write Name or package/Name, without blanks",
    ),
    "name_of_a_surrogate": (
        'name: "\\ud800"\nspec_type: interface\n',
        "1:1: error: '\\ud800' cannot be the name of a capability\n"
        "    write Name or package/Name, without blanks",
    ),
    "nameless": (
        "spec_type: interface\n",
        "1:1: error: the file has no 'name'\n    add it",
    ),
    "other_kind": (
        "name: Grasp\nspec_type: semantic_interface\nredefines: arm/Lift\n",
        "2:1: warning: spec_type is semantic_interface, but the place of the file says interface\n"
        "    move the file, or change spec_type",
    ),
    "kind": (
        "name: Grasp\nspec_type: interfaces\n",
        "2:1: error: 'interfaces' is not a spec_type\n    did you mean 'interface'?",
    ),
    "kind_list": (
        "name: Grasp\nspec_type: [a]\n",
        "2:1: error: a list is not a spec_type\n"
        "    the types are interface, provider, semantic_interface",
    ),
}


@pytest.mark.parametrize("case", INTERFACE_CASES)
def test_defects_of_an_interface(tmp_path: Path, case: str) -> None:
    text, expected = INTERFACE_CASES[case]
    files: dict[str, str | bytes] = {
        "arm/interfaces/Lift.yaml": "name: Lift\nspec_type: interface\n",
        "arm/providers/Other.yaml": "name: Other\nspec_type: provider\nimplements: arm/Lift\n",
        "arm/providers/Grasp.yaml": PROVIDER,
        "arm/interfaces/Grasp.yaml": text,
    }
    loaded = load(tmp_path, files)
    actual = [one for one in said(loaded, tmp_path) if one.startswith("arm/interfaces/Grasp.yaml:")]
    assert actual == ["arm/interfaces/Grasp.yaml:" + expected]


def test_an_interface_that_nobody_describes(tmp_path: Path) -> None:
    files: dict[str, str | bytes] = {
        "arm/providers/Grasp.yaml": PROVIDER,
        "new/interfaces/Grasp.yaml": INTERFACE + "formerly: [x/Y]\n",
        "new/providers/Old.yaml": "name: Old\nspec_type: provider\nimplements: x/Y\n",
        "new/semantic_interfaces/S.yaml": "name: S\n# of another robot\nredefines: q/R\n",
    }
    assert said(load(tmp_path, files), tmp_path) == [
        "4:1: warning: it implements 'arm/Grasp', which no file describes\n"
        "    did you mean 'new/Grasp'?",
        "new/providers/Old.yaml:3:1: warning: it implements 'x/Y', which no file describes\n"
        "    it is called 'new/Grasp' here",
        "new/semantic_interfaces/S.yaml:3:1: warning: it redefines 'q/R', which no file describes\n"
        "    describe it, or load its files as well",
    ]


def test_a_file_without_package_or_kind(tmp_path: Path) -> None:
    files: dict[str, str | bytes] = {
        "a.yaml": "name: a\nspec_type: interface\n",
        "b.yaml": "name: b\n# spec_type is missing\n",
    }
    assert said(load(tmp_path, files), tmp_path) == [
        "a.yaml:1:1: error: it is not known which package 'a' belongs to\n"
        "    write 'name: package/Name', or put the file into package/interfaces or the like",
        "b.yaml:1:1: error: the file has no 'spec_type', so it is not known what it describes\n"
        "    add it; one of interface, provider, semantic_interface",
    ]


def test_what_does_not_fit_is_left_out_and_the_rest_is_kept(tmp_path: Path) -> None:
    body = PARAMETERS + "    - {name: a, type: what, minimum: x}\n    - nothing\n    - {name: b}\n"
    loaded, texts = provider(tmp_path, body)
    assert len(texts) == 3
    first, second = loaded.library.providers[0].configuration
    assert (first.name, first.type, first.minimum) == ("a", ValueType.ANY, None)
    assert second.name == "b"


@pytest.mark.parametrize(
    "unless", ["[speed]", "{speed: fast}", "{spede: 1}", "{speed: 1, mode: [a]}", "5"]
)
def test_never_fails_is_not_claimed_if_its_exceptions_are_not_understood(
    tmp_path: Path, unless: str
) -> None:
    loaded, texts = provider(
        tmp_path, DESCRIBED + f"outcomes: {{never_fails: true, unless: {unless}}}\n"
    )
    assert len(texts) == 1
    assert loaded.library.providers[0].outcomes == Outcomes()


def test_defects_of_one_file_are_bounded(tmp_path: Path) -> None:
    body = "".join(f"key{number}: 1\n" for number in range(1000))
    loaded, _ = provider(tmp_path, body)
    assert len(loaded.defects) == 100


def test_a_dependency_whose_provider_is_one_of_another_interface(tmp_path: Path) -> None:
    body = "depends_on:\n  arm/Lift: {provider: arm/Grasp}\n"
    lift: dict[str, str | bytes] = {
        "arm/interfaces/Grasp.yaml": INTERFACE,
        "arm/providers/Grasp.yaml": PROVIDER,
        "arm/interfaces/Lift.yaml": INTERFACE.replace("Grasp", "Lift"),
        "arm/providers/Lift.yaml": PROVIDER.replace("Grasp", "Lift") + body,
    }
    (defect,) = load(tmp_path, lift).defects
    assert str(defect).endswith(
        "Lift.yaml:6:3: warning: it depends on the provider 'arm/Grasp' for 'arm/Lift', which "
        "implements 'arm/Grasp'\n    write 'arm/Grasp', or another provider"
    )


def test_all_defects_of_a_file_that_is_not_used_are_errors_and_its_name_stays() -> None:
    notes = Notes("a: warning: b.yaml")
    notes.warning((2, 1), "hardly meant so", "write something else")
    notes.error((1, 1), "no mapping")
    assert errors_text(notes) == (
        "a: warning: b.yaml:1:1: error: no mapping\n"
        "a: warning: b.yaml:2:1: error: hardly meant so\n    write something else"
    )
