"""Stories are data until somebody reads them, and each vocabulary has its words for them."""

from __future__ import annotations

import string

import pytest

from gpsfsm.model.event import Event
from gpsfsm.model.story import Actor, Sentence, Statement, Vocabulary, remark

GO = Actor("/Plan/Runner[1]", "Go (text=the plan gives up {0} {terms}) at line 1")
SAY = Actor("/Plan/Runner[5]", "Say at line 5")


def sample(statement: Statement) -> Sentence:
    """A sentence with this statement."""
    if statement.event is not None:
        return Sentence(statement, (GO,))
    return Sentence(statement, count=7, arguments=("{x}", "y")[: statement.arity])


@pytest.mark.parametrize("vocabulary", Vocabulary)
@pytest.mark.parametrize("statement", Statement)
def test_every_statement_has_words_in_every_vocabulary(
    statement: Statement, vocabulary: Vocabulary
) -> None:
    text = sample(statement).text(vocabulary)
    assert text.strip() == text != ""
    fields = {field for _, field, _, _ in string.Formatter().parse(statement.value) if field}
    assert {"count"} >= {
        field for field in fields if not field.startswith("terms.") and not field.isdigit()
    }


def test_the_words_of_a_user_stay_as_they_are() -> None:
    sentence = Sentence(Statement.SUCCEEDS, (GO,))
    for vocabulary in Vocabulary:
        assert sentence.text(vocabulary) == f"{GO.name} succeeds"
    assert remark("{0} the plan").text(Vocabulary.TREE) == "{0} the plan"


def test_a_row_names_its_first_and_its_last() -> None:
    sentence = Sentence(Statement.FAILS, (GO, SAY), 3)
    assert sentence.text(Vocabulary.PLAN) == f"{GO.name} fails, and so do 3 more and {SAY.name}"
    assert sentence.statement.event is Event.FAILED


def test_one_statement_in_all_vocabularies() -> None:
    sentence = Sentence(Statement.UNHANDLED_FAILURE)
    assert [sentence.text(each) for each in Vocabulary] == [
        "nothing handles this failure: the plan gives up",
        "nothing handles this failure: the tree fails",
        "nothing handles this failure: the plan hangs",
        "nothing handles this failure: the machine gives up",
    ]


@pytest.mark.parametrize(
    ("statement", "actors", "arguments"),
    [
        (Statement.SUCCEEDS, (), ()),
        (Statement.SUCCEEDS, (GO, SAY, GO), ()),
        (Statement.SUCCEEDS, (GO,), ("more",)),
        (Statement.WAITS_FOR_EVER, (), ()),
        (Statement.WAITS_FOR_EVER, (GO,), ("x",)),
        (Statement.STUCK, (), ("x",)),
    ],
)
def test_a_sentence_without_what_it_states_is_none(
    statement: Statement, actors: tuple[Actor, ...], arguments: tuple[str, ...]
) -> None:
    with pytest.raises(ValueError, match=statement.name):
        Sentence(statement, actors, arguments=arguments)
