"""Hypothesis strategies for texts that are plans, nearly plans, or no plans.

A writer makes many small decisions, each between something that a plan may hold and something that
it may not. Every bad choice here spoils the text by itself, wherever the writer may make it, so the
writer knows what must become of a text with no bad choice and of one with a single bad choice.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from hypothesis import strategies as st

if TYPE_CHECKING:
    from hypothesis.strategies import DrawFn, SearchStrategy

TYPES = ("sequential", "recovery", "parallel_any", "parallel_all")

# --- what may stand in a plan, and what may not; odd characters are written as escapes ------------

FILLED = (
    *("demo/GoRunner", "1", " a ", "\u00a0", "&#160;", "&#xa;x", "\u2003", "&amp;", "&quot;", ">"),
    *("\u00e9", "\U0001f916", "a\r\nb", "]]>", "--", "\ufffd", "&#x10FFFF;", "{urn:p}", "\x85"),
)
BLANK = ("", " ", "\t", "\r\n", "&#32;", "&#x9;&#10;", " &#xD; ")
NOT_VALUES = (
    *("a & b", "&", "&nbsp;", "<", "a<b", "&#0;", "&#xFFFE;", "&#55296;", "&#x;", "&amp"),
    *("\x00", "\x1b", "\ufffe", "\ud800", "&#1114112;", "&#-1;", "&#x 41;"),
)
RIGHT_TYPES = (*TYPES, "&#x73;equential", "recover&#121;")
WRONG_TYPES = (
    *("Sequential", "parallel", "fallback", "recovery sequential", "recov\u0435ry", "recovery&"),
    *(" sequential", "recovery ", "recovery\n", "&#9;recovery", "recovery&#xA0;", *BLANK),
)

FILLERS = (
    *("", " ", "\n  ", "\t\r\n", "<!-- note -->", "<!---->", "<!-- <Runner/> & -->", "\r"),
    *("<?note?>", "<?note a > b & <c>?>", "<?xml-model href='plan.rng'?>", "<?Plan ?>"),
)
INNER_FILLERS = (
    *(*FILLERS, "<![CDATA[]]>", "<![CDATA[ \n]]>", "&#32;", " &#xA;&#13; ", "&#9;<!-- x -->&#9;"),
    " <!-- gpsfsm: ignore GP302 --> ",
)
STRAY_TEXTS = (
    *("x", "\u00a0", "&#160;", "&amp;", "&lt;Runner/&gt;", "<![CDATA[x]]>", "<![CDATA[ \u00a0 ]]>"),
    *("&nbsp;", "&", "]]>", "<![CDATA[", "<!-- -- -->", "<!-- --->", "<!--", "<?xml?>", "<??>"),
    *("<?a:b?>", "\x00", "\x85", "\ufeff", "\ud800", "&#0;", "&#11;", "</Plan>", "</Control>", "<"),
    *('<?xml version="1.0"?>', "<?XML version='1.0'?>", "<!ENTITY a 'b'>", "```", "<!x>", "< a/>"),
    *("<![CDATA[a]]", "<?note", "<![cdata[ ]]>", "&#32;.&#32;", " <!-- a -->b<!-- c --> "),
)
STRAY_ELEMENTS = (
    *("<Plan/>", "<plan/>", "<runner interface='a' provider='b'/>", "<Sequence></Sequence>"),
    *("<Event name='a' provider='b'/>", "<q:Runner interface='a' provider='b'/>", "<xml:Runner/>"),
    "<p:Control xmlns:p='urn:p' type='recovery'/>",
    "<Control xmlns='urn:p' type='recovery'/>",
    "<Runner xmlns='urn:p' interface='a' provider='b'/>",
    "<Runner xmlns=' ' interface='a' provider='b'/>",
    "<Runner p:interface='a' p:provider='b' xmlns:p='urn:p'/>",
    "<Control p:type='recovery' xmlns:p='urn:p'/>",
    "<Control xmlns='urn:p' type='recovery'><Control xmlns='' type='recovery'/></Control>",
    *("<Control/>", "<Runner/>", "<Control type='recovery'>", "<:Runner/>", "<Runner:/>"),
)
ELEMENTS = ("<Runner interface='a' provider='b'/>", "<Control type='recovery'></Control>")

NAMES = (
    *("name", "id", "x", "y", "goal", "Type", "Interface", "\u00e9", "_", "a.b-c"),
    *("xml:lang", "xml:space", "xml:base", "xmlnsx", "p:x", "p:type", "p:interface", "p:provider"),
)
DECLARATIONS = (
    *((" xmlns", ""), (" xmlns:r", "urn:r"), ("\nxmlns:s", "urn:p")),
    (" xmlns:xml", "http://www.w3.org/XML/1998/namespace"),
)
BAD_ATTRIBUTES = (
    *(" x", " x=1", " x==''", " x='1' x='2'", " x='1'k='2'", " x='", ' x="1', " ='1'", " 1='1'"),
    *(" xmlns='urn:p'", " xmlns=' '", " xmlns:k=''", " xmlns:xmlns='urn:p'", " xmlns:xml='urn:p'"),
    *(" k:x='1'", " :x='1'", " x:='1'", " a:b:c='1'", " xmlns:='urn:p'", " p:x='1' p:x='1'"),
    " xmlns='http://www.w3.org/XML/1998/namespace'",
    " xmlns:k='http://www.w3.org/2000/xmlns/'",
    " k:x='1' l:x='2' xmlns:k='urn:k' xmlns:l='urn:k'",
    # The warning for xml:space makes lxml forget the error before it.
    " xmlns:k='a b' xml:space='odd'",
    *(" xml:id='1 2'", " k:x='1' xml:space='odd'", " xmlns:k='a b'", " xmlns:k=']'"),
    *(" &#120;='1'", " x&='1'", " \u00a0x='1'", "\u00a0", " /", " <", " x='1'\x00"),
)
BAD_NAMES = (
    *("plan", "Runner", "control", "runner", "Plan", "Sequence", "k:Control", "xml:Runner", "1"),
    *("Runner\u00a0", "p:Runner", "R&unner", ""),
)
PROLOGS = (
    *("", "", '<?xml version="1.0"?>', "<?xml version='1.0' encoding='UTF-8' ?>\n", "\ufeff"),
    *('<?xml version="1.0" encoding="iso-8859-1" standalone="yes"?>', '<?xml version="1.1"?>'),
    "\ufeff<?xml version='1.0' encoding='ascii'?>",
)
BAD_PROLOGS = (
    *(' <?xml version="1.0"?>', "<!DOCTYPE Plan>", '<!DOCTYPE Plan SYSTEM "plan.dtd">', "text "),
    *("<!DOCTYPE Plan [<!ENTITY a 'b'>]>", "<?xml version='1.0' encoding=UTF-8?>", "<Plan/>"),
    *("<?xml?>", "&#32;", "<![CDATA[ ]]>", "\ufeff\ufeff", "\x00", "<?xml encoding='UTF-8'?>"),
    *('<?xml version="1.0">', "<!doctype Plan>", "<!DOCTYPE", "\u00a0", "<!-- -- -->"),
)
BAD_EPILOGS = (
    *("text", "<Plan/>", "</Plan>", "&#32;", "<![CDATA[ ]]>", "<!DOCTYPE Plan>", "\ufeff", "<"),
    *("<!--", "\x00", "\x1a", "<?xml version='1.0'?>", "\u00a0", "<?note", "```"),
)

# --- the writer ----------------------------------------------------------------------------------


class Text(NamedTuple):
    """A text and the number of bad choices in it."""

    text: str
    spoiled: int


class _Writer:
    """Writes one text; ``fuse`` is the number of good decisions before the only bad one.

    With a ``rate`` instead every decision is bad once in so many times; with neither none is.
    """

    def __init__(self, draw: DrawFn, *, fuse: int | None = None, rate: int = 0) -> None:
        self._draw, self._fuse, self._rate = draw, fuse, rate
        self.spoiled = 0
        self._declared = draw(st.booleans())

    def text(self) -> str:
        parts = [self._pick(PROLOGS, BAD_PROLOGS), self._pick(FILLERS)]
        parts.append(self._element("Plan", depth=self._draw(st.integers(0, 3))))
        parts += [self._pick(FILLERS), self._pick(("",), BAD_EPILOGS)]
        return "".join(parts)

    def _pick(self, good: tuple[str, ...], bad: tuple[str, ...] = ()) -> str:
        return self._draw(st.sampled_from(bad if bad and self._is_bad() else good))

    def _is_bad(self) -> bool:
        if self._rate:
            due = self._draw(st.integers(1, self._rate)) == self._rate
        elif self._fuse is not None:
            due = self._fuse == 0
            self._fuse -= 1
        else:
            due = False
        self.spoiled += due
        return due

    def _element(self, name: str, *, depth: int) -> str:
        bad_names = tuple(bad for bad in BAD_NAMES if bad != name)
        if name == "Plan":
            bad_names = (*bad_names, "Control")
        written = self._pick((name,), bad_names)
        head = f"<{written}{self._attributes(name)}{self._pick(('', ' ', self._line()))}"
        runner = name == "Runner"
        inside = self._runner_content() if runner else self._content(depth)
        if not inside and self._draw(st.booleans()):
            return head + self._pick(("/>",), (">", "/", "/ >", "", "//>", "/></Runner>"))
        ends = (f"</{written}>", f"</{written}\n>")
        bad_ends = ("", f"</{written}", f"</ {written}>", f"</{written}x>", f"</{written} a='1'>")
        return f"{head}>{inside}{self._pick(ends, bad_ends)}"

    def _line(self) -> str:
        return self._pick(("\n", "\r\n", "\t"))

    def _attributes(self, name: str) -> str:
        results: list[str] = []
        if name == "Plan" and self._declared:
            results.append(" xmlns:p='urn:p'")
        if name == "Runner":
            needed = [("interface", FILLED, BLANK), ("provider", FILLED, BLANK)]
        else:
            needed = [("type", RIGHT_TYPES, WRONG_TYPES)] if name == "Control" else []
        for attribute, good, bad in needed:
            value = self._pick(good, (*bad, *NOT_VALUES, "omit"))
            if value != "omit":
                results.append(self._attribute(f" {attribute}", value))
        results += self._extras(frozenset(attribute for attribute, _, _ in needed))
        results.append(self._pick(("",), BAD_ATTRIBUTES))
        return "".join(self._draw(st.permutations(results)))

    def _extras(self, taken: frozenset[str]) -> list[str]:
        """Attributes that any element may have."""
        names = [name for name in NAMES if self._declared or not name.startswith("p:")]
        names += [name for name in ("type", "interface", "provider") if name not in taken]
        chosen = self._draw(st.lists(st.sampled_from(names), max_size=2, unique=True))
        actual = [
            self._attribute(f" {name}", self._pick((*FILLED, *BLANK), NOT_VALUES))
            for name in chosen
        ]
        declared = self._draw(
            st.lists(st.sampled_from(DECLARATIONS), max_size=1) if not actual else st.just([])
        )
        return actual + [self._attribute(*pair) for pair in declared]

    def _attribute(self, name: str, value: str) -> str:
        quote = self._pick(("'", '"'))
        equals = self._pick(("=", " = ", "=\n"))
        return f"{name}{equals}{quote}{value}{quote}"

    def _runner_content(self) -> str:
        if self._draw(st.booleans()):
            return self._pick(("",), (*STRAY_TEXTS, *STRAY_ELEMENTS, *ELEMENTS))
        return self._pick(INNER_FILLERS) + self._pick(
            INNER_FILLERS, (*STRAY_TEXTS, *STRAY_ELEMENTS, *ELEMENTS)
        )

    def _content(self, depth: int) -> str:
        parts: list[str] = []
        for _ in range(self._draw(st.integers(0, 3))):
            parts.append(self._pick(INNER_FILLERS))
            name = self._pick(("Runner", "Control")) if depth else "Runner"
            parts.append(self._element(name, depth=depth - 1))
        parts.append(self._pick(INNER_FILLERS, (*STRAY_TEXTS, *STRAY_ELEMENTS)))
        return "".join(parts)


@st.composite
def plans(draw: DrawFn) -> str:
    """A plan text, written in all the ways that XML allows."""
    return _Writer(draw).text()


@st.composite
def spoiled_plans(draw: DrawFn) -> Text:
    """A plan text with one thing wrong, or with nothing where the text ended before."""
    writer = _Writer(draw, fuse=draw(st.integers(0, 30)))
    text = writer.text()
    return Text(text, writer.spoiled)


@st.composite
def wild_texts(draw: DrawFn) -> Text:
    """A text with any number of things wrong."""
    writer = _Writer(draw, rate=draw(st.sampled_from([5, 20, 60])))
    text = writer.text()
    return Text(text, writer.spoiled)


_SNIPPETS = (
    *(
        "<",
        ">",
        "/",
        "/>",
        "</",
        "&",
        ";",
        "&#",
        "x",
        "'",
        '"',
        "=",
        " ",
        "\n",
        "-",
        "--",
        "!",
        "?",
    ),
    *("<!--", "-->", "<![CDATA[", "]]>", "<?", "?>", ":", "xmlns", "xml", "p:", "a", "1", "\u00a0"),
    *(
        "Plan",
        "Control",
        "Runner",
        "type",
        "interface",
        "<Plan>",
        "</Plan>",
        "\x00",
        "\r",
        "]",
        "[",
    ),
)


@st.composite
def mutated_plans(draw: DrawFn) -> str:
    """A plan text in which pieces are deleted, inserted, replaced or doubled."""
    text = draw(plans())
    for _ in range(draw(st.integers(1, 3))):
        start = draw(st.integers(0, len(text)))
        stop = min(len(text), start + draw(st.sampled_from([0, 0, 1, 1, 1, 2, 5, 20])))
        inserted = draw(_pieces(text))
        text = text[:start] + inserted + text[stop:]
    return text


def _pieces(text: str) -> SearchStrategy[str]:
    """Something to insert: nothing, a snippet, a piece of the text itself, a character."""
    places = st.integers(0, len(text))
    return st.one_of(
        st.just(""),
        st.sampled_from(_SNIPPETS),
        st.tuples(places, st.integers(1, 30)).map(lambda cut: text[cut[0] : cut[0] + cut[1]]),
        st.characters(),
    )
