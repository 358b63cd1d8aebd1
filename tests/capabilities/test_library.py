"""How names in plans are looked up: dialects, semantic interfaces, providers, attributes."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import pytest

from gpsfsm.capabilities.library import (
    EMPTY,
    Capabilities,
    Library,
    bind,
    builtin_capabilities,
    namespace,
)
from gpsfsm.checking import CheckOptions
from gpsfsm.model.capability import (
    Effects,
    Interface,
    Output,
    Parameter,
    PromptBuffer,
    Provider,
    SemanticInterface,
)
from tests.support import plan_of

if TYPE_CHECKING:
    from gpsfsm.model.capability import Binding

SPEED = Parameter("speed", aliases=("velocity", "pace"))
FORCE = Parameter("force", default=2.0)
GRASP = Interface("arm/Grasp", formerly=("old/Grab", "older/Grab"))
GRASPS = Provider(
    "arm/Grasp",
    "arm/Grasp",
    described=True,
    configuration=(SPEED, FORCE),
    effects=Effects(PromptBuffer("uuid", "flush")),
    resources=("arm",),
)
QUICKLY = Provider("arm/Aardvark", "arm/Grasp", described=True)
RELEASE = Interface("arm/Release", formerly=("old/Let",))
RELEASES = Provider("arm/Release", "arm/Release", described=True)
SECRET = Provider("arm/Secret", "arm/Grasp")
PICK = SemanticInterface("shop/Pick", redefines="arm/Grasp")
PICKS = Provider("shop/Picker", "shop/Pick", described=True)
NOTHING = SemanticInterface("shop/Nothing", redefines="arm/Missing")
LIBRARY = Library(
    interfaces=(GRASP, RELEASE),
    providers=(QUICKLY, GRASPS, RELEASES, SECRET, PICKS),
    semantic=(NOTHING, PICK),
)


def bound(
    interface: str, provider: str = "", attributes: str = "", library: Library = LIBRARY
) -> Binding | None:
    """What is known about the only runner of a plan."""
    runner = f'<Runner interface="{interface}" provider="{provider or interface}" {attributes}/>'
    # inside a control, since a completion runner at the end of a plan is none of its runners
    plan = plan_of(f'<Plan><Control type="sequential">{runner}</Control></Plan>')
    (binding,) = bind(plan, library)
    return binding


def binding_of(
    interface: str, provider: str = "", attributes: str = "", library: Library = LIBRARY
) -> Binding:
    binding = bound(interface, provider, attributes, library)
    assert binding is not None
    return binding


class TestNames:
    @pytest.mark.parametrize(
        ("name", "expected"),
        [("a/B", "a"), ("a/b/C", "a"), ("/B", ""), ("B", ""), ("", "")],
    )
    def test_the_package_is_what_is_before_the_first_slash(self, name: str, expected: str) -> None:
        assert namespace(name) == expected

    @pytest.mark.parametrize(
        ("name", "here"),
        [
            ("old/Grab", "arm/Grasp"),
            ("older/Grab", "arm/Grasp"),
            ("old/Let", "arm/Release"),
            ("arm/Grasp", None),
            ("shop/Pick", None),
            ("old/Unknown", None),
            ("", None),
        ],
    )
    def test_older_names_are_translated(self, name: str, here: str | None) -> None:
        assert LIBRARY.translation(name) == here

    def test_a_name_in_use_is_not_an_older_name_of_another(self) -> None:
        greedy = Interface("arm/Greedy", formerly=("arm/Grasp", "shop/Pick", "old/Grab"))
        library = LIBRARY.extended(Library(interfaces=(greedy,)))
        assert library.translation("arm/Grasp") is None
        assert library.translation("shop/Pick") is None
        assert library.interface("arm/Grasp") is GRASP

    def test_of_two_claims_to_an_older_name_the_first_holds(self) -> None:
        also = Interface("zoo/Grab", formerly=("old/Grab",))
        assert Library(interfaces=(GRASP, also)).translation("old/Grab") == "arm/Grasp"
        assert Library(interfaces=(also, GRASP)).translation("old/Grab") == "zoo/Grab"

    def test_a_semantic_interface_is_the_one_that_it_redefines(self) -> None:
        assert LIBRARY.interface("shop/Pick") is GRASP
        assert LIBRARY.interface("shop/Nothing") is None
        assert LIBRARY.interface("old/Grab") is None  # only translated names are looked up

    def test_what_there_is(self) -> None:
        assert LIBRARY.interface_names == ("arm/Grasp", "arm/Release", "shop/Nothing", "shop/Pick")
        assert LIBRARY.namespaces == {"arm", "shop"}
        assert LIBRARY.provider("arm/Aardvark") is QUICKLY
        assert LIBRARY.provider("old/Grab") is None


class TestProviders:
    def names(self, interface: str, library: Library = LIBRARY) -> list[str]:
        return [provider.name for provider in library.providers_of(interface)]

    def test_the_one_with_the_name_of_the_interface_comes_first(self) -> None:
        assert self.names("arm/Grasp") == ["arm/Grasp", "arm/Aardvark", "arm/Secret"]

    def test_a_declared_default_comes_before_it(self) -> None:
        chosen = replace(GRASP, default_provider="arm/Secret")
        library = replace(LIBRARY, interfaces=(chosen, RELEASE))
        assert self.names("arm/Grasp", library) == ["arm/Secret", "arm/Aardvark", "arm/Grasp"]

    def test_a_default_that_is_not_described_changes_nothing(self) -> None:
        chosen = replace(GRASP, default_provider="arm/Gone")
        library = replace(LIBRARY, interfaces=(chosen, RELEASE))
        assert self.names("arm/Grasp", library) == ["arm/Aardvark", "arm/Grasp", "arm/Secret"]

    def test_without_any_default_they_come_by_name(self) -> None:
        library = replace(LIBRARY, providers=(SECRET, QUICKLY))
        assert self.names("arm/Grasp", library) == ["arm/Aardvark", "arm/Secret"]

    def test_those_of_a_semantic_interface_count_for_it_alone(self) -> None:
        assert self.names("shop/Pick") == ["arm/Grasp", "arm/Aardvark", "arm/Secret", "shop/Picker"]
        assert "shop/Picker" not in self.names("arm/Grasp")

    def test_nobody_implements_what_is_not_described(self) -> None:
        assert self.names("arm/Missing") == self.names("shop/Nothing") == []


class TestExtension:
    def test_entries_of_the_other_library_replace_those_of_the_same_name(self) -> None:
        ours = replace(GRASPS, runner="ours")
        added = Interface("aaa/New")
        other = Library(
            interfaces=(added, replace(RELEASE, formerly=("old/Free",))),
            providers=(ours,),
            semantic=(replace(PICK, redefines="arm/Release"),),
        )
        assert LIBRARY.translation("old/Let") == "arm/Release"  # the old answer must not stay
        both = LIBRARY.extended(other)
        assert [interface.name for interface in both.interfaces] == [
            "aaa/New",
            "arm/Grasp",
            "arm/Release",
        ]
        assert both.provider("arm/Grasp") is ours
        assert both.providers_of("arm/Grasp")[0] is ours
        assert both.provider("arm/Secret") is SECRET
        assert both.translation("old/Let") is None
        assert both.translation("old/Free") == "arm/Release"
        assert both.interface("shop/Pick") == replace(RELEASE, formerly=("old/Free",))
        assert LIBRARY.provider("arm/Grasp") is GRASPS

    def test_what_old_schemas_cannot_say_of_an_interface_stays(self) -> None:
        ours = replace(GRASP, default_provider="arm/Aardvark")
        plain = Interface("arm/Grasp", description="new", version="1")
        both = replace(LIBRARY, interfaces=(ours,)).extended(Library(interfaces=(plain,)))
        assert both.interface("arm/Grasp") == replace(
            plain, formerly=GRASP.formerly, default_provider="arm/Aardvark"
        )
        other = replace(plain, default_provider="arm/Secret")
        actual = both.extended(Library(interfaces=(other,))).interface("arm/Grasp")
        assert actual is not None
        assert actual.default_provider == "arm/Secret"

    def test_a_provider_that_is_only_named_keeps_its_definition(self) -> None:
        named = Provider("arm/Grasp", "arm/Grasp", runner="r", version="1", origin="ours.yaml")
        both = LIBRARY.extended(Library(providers=(named,)))
        wanted = replace(GRASPS, runner="r", version="1", origin="ours.yaml", lent=True)
        assert both.provider("arm/Grasp") == wanted

    @pytest.mark.parametrize(
        "new",
        [
            Provider("arm/Grasp", "arm/Grasp", described=True),
            Provider("arm/Grasp", "arm/Release"),
            Provider("arm/Secret", "arm/Grasp", runner="r"),
            Provider("arm/New", "arm/Grasp"),
        ],
    )
    def test_any_other_provider_is_as_the_new_file_says(self, new: Provider) -> None:
        assert LIBRARY.extended(Library(providers=(new,))).provider(new.name) == new

    @pytest.mark.parametrize("first", [False, True])
    @pytest.mark.parametrize("second", [False, True])
    def test_is_complete_if_one_of_the_two_is(self, first: bool, second: bool) -> None:
        both = Library(complete=first).extended(Library(complete=second))
        assert both.complete is (first or second)


class TestBinding:
    @pytest.mark.parametrize(
        ("interface", "provider", "expected"),
        [
            ("arm/Grasp", "arm/Grasp", "arm/Grasp"),
            ("arm/Grasp", "arm/Aardvark", "arm/Aardvark"),
            ("arm/Grasp", "old/Grab", "arm/Grasp"),
            ("arm/Grasp", "older/Grab", "arm/Grasp"),
            ("old/Grab", "old/Grab", "arm/Grasp"),
            ("old/Grab", "older/Grab", "arm/Grasp"),
            ("old/Grab", "arm/Grasp", "arm/Grasp"),
            ("old/Grab", "arm/Aardvark", "arm/Aardvark"),
            ("shop/Pick", "shop/Picker", "shop/Picker"),
            ("shop/Pick", "shop/Pick", "arm/Grasp"),
            ("shop/Pick", "arm/Aardvark", "arm/Aardvark"),
            ("arm/Grasp", "arm/Release", None),
            ("arm/Grasp", "old/Let", None),
            ("old/Grab", "arm/Release", None),
            ("arm/Grasp", "arm/Gone", None),
            ("arm/Grasp", "arm/Secret", None),
            ("arm/Grasp", "shop/Picker", None),
            ("arm/Missing", "arm/Grasp", None),
            ("shop/Nothing", "arm/Grasp", None),
        ],
    )
    def test_interface_and_provider_must_fit(
        self, interface: str, provider: str, expected: str | None
    ) -> None:
        binding = bound(interface, provider)
        if expected is None:
            assert binding is None
        else:
            assert binding is not None
            assert (binding.interface.name, binding.provider.name) == ("arm/Grasp", expected)

    def test_the_provider_of_another_dialect_is_the_default_one(self) -> None:
        chosen = replace(GRASP, default_provider="arm/Aardvark")
        library = replace(LIBRARY, interfaces=(chosen, RELEASE))
        assert binding_of("old/Grab", library=library).provider.name == "arm/Aardvark"
        assert binding_of("arm/Grasp", library=library).provider.name == "arm/Grasp"

    def test_the_provider_of_another_dialect_may_be_described_by_nobody(self) -> None:
        assert bound("old/Grab", library=replace(LIBRARY, providers=(RELEASES, SECRET))) is None
        assert bound("old/Grab", library=replace(LIBRARY, providers=())) is None

    def test_bindings_come_in_document_order(self) -> None:
        runners = "".join(
            f'<Runner interface="{name}" provider="{name}"/>'
            for name in ("arm/Release", "arm/Missing", "arm/Grasp")
        )
        nested = f'<Plan><Control type="sequential">{runners}</Control></Plan>'
        actual = [each and each.interface.name for each in bind(plan_of(nested), LIBRARY)]
        assert actual == ["arm/Release", None, "arm/Grasp"]

    def test_nothing_is_known_without_capabilities(self) -> None:
        assert bound("arm/Grasp", library=EMPTY.library) is None

    def test_older_engines_keep_prompts_by_other_rules(self) -> None:
        here, elsewhere = binding_of("arm/Grasp").provider, binding_of("old/Grab").provider
        assert here.effects == GRASPS.effects
        assert elsewhere == replace(GRASPS, effects=Effects())
        assert binding_of("old/Grab", "arm/Grasp").provider == elsewhere
        assert binding_of("shop/Pick").provider.effects == GRASPS.effects
        assert binding_of("old/Grab", "arm/Aardvark").provider is QUICKLY

    def test_an_answer_of_an_older_engine_need_not_be_read(self) -> None:
        asks = replace(
            GRASPS,
            outputs=(Output("answer"), Output("other"), Output("success", status=True)),
            effects=Effects(PromptBuffer("uuid", "flush", "answer")),
        )
        library = replace(LIBRARY, providers=(asks,))
        here, elsewhere = (
            binding_of("arm/Grasp", library=library),
            binding_of("old/Grab", library=library),
        )
        assert [output.status for output in here.provider.outputs] == [False, False, True]
        assert [output.status for output in elsewhere.provider.outputs] == [True, False, True]

    def test_files_of_an_older_dialect_that_say_little_are_completed(self) -> None:
        older = Library(
            interfaces=(Interface("old/Grab"),), providers=(Provider("old/Grab", "old/Grab"),)
        )
        binding = binding_of("old/Grab", library=LIBRARY.extended(older))
        assert binding.interface.name == "old/Grab"
        assert binding.provider == replace(GRASPS, effects=Effects())
        full = replace(older.providers[0], described=True)
        both = LIBRARY.extended(replace(older, providers=(full,)))
        assert binding_of("old/Grab", library=both).provider is full

    def test_undescribed_providers_of_todays_names_stay_so(self) -> None:
        both = Library(interfaces=(GRASP,), providers=(replace(GRASPS, described=False),))
        assert bound("arm/Grasp", library=both) is None
        assert bound("old/Grab", library=both) is None


class TestAttributes:
    def written(self, attributes: str) -> dict[str, str]:
        written = binding_of("arm/Grasp", attributes=attributes).written
        return {name: attribute.text for name, attribute in written.items()}

    def test_stand_under_the_name_of_the_parameter(self) -> None:
        assert self.written('velocity="3"') == {"speed": "3"}
        assert self.written('speed="1" force="2"') == {"speed": "1", "force": "2"}

    @pytest.mark.parametrize(
        "attributes",
        [
            'speed="1" velocity="3"',
            'velocity="3" speed="1"',
            'pace="4" velocity="3" speed="1"',
        ],
    )
    def test_the_name_itself_wins_over_an_alias(self, attributes: str) -> None:
        assert self.written(attributes) == {"speed": "1"}

    def test_of_two_aliases_the_first_that_is_written_wins(self) -> None:
        assert self.written('velocity="3" pace="4"') == {"speed": "3"}
        assert self.written('pace="4" velocity="3"') == {"speed": "4"}

    def test_unknown_ones_stay_and_labels_are_none(self) -> None:
        assert self.written('colour="red" name="n" id="7"') == {"colour": "red"}

    def test_values(self) -> None:
        binding = binding_of("arm/Grasp", attributes='velocity="3" colour="red"')
        assert [binding.value(name) for name in ("speed", "force", "colour", "gone")] == [
            3,
            2.0,
            "red",
            None,
        ]


class TestBuiltin:
    LIBRARY = builtin_capabilities().library

    def test_is_what_a_check_uses(self) -> None:
        assert CheckOptions().described is builtin_capabilities()
        assert CheckOptions(capabilities=Capabilities(LIBRARY)).described.library is LIBRARY
        assert CheckOptions(capabilities=EMPTY).described is EMPTY

    def test_describes_no_robot_completely_and_has_no_defects(self) -> None:
        assert not self.LIBRARY.complete
        assert builtin_capabilities().defects == ()

    def test_every_name_of_every_dialect_is_bound(self) -> None:
        older = 0
        for interface in self.LIBRARY.interfaces:
            default, *_ = self.LIBRARY.providers_of(interface.name)
            here = binding_of(interface.name, default.name, library=self.LIBRARY)
            assert here.provider is default
            for name in interface.formerly:
                older += 1
                assert self.LIBRARY.translation(name) == interface.name
                elsewhere = binding_of(name, library=self.LIBRARY)
                assert elsewhere.interface is interface
                outputs = elsewhere.provider.outputs
                assert elsewhere.provider == replace(default, effects=Effects(), outputs=outputs)
                names = [output.name for output in default.outputs]
                assert [output.name for output in outputs] == names
        assert older > len(self.LIBRARY.interfaces)
