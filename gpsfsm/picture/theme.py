"""The style sheet of pictures: colours for light and dark, dashes and forms for everybody."""

from __future__ import annotations

__all__ = ["STYLE"]

_FONT = "ui-sans-serif,system-ui,'DejaVu Sans',Helvetica,Arial,sans-serif"

_LIGHT = {
    "paper": "#ffffff",
    "text": "#1f2328",
    "soft": "#59636e",
    "line": "#8c959f",
    "node": "#ffffff",
    "even": "#f6f8fa",
    "odd": "#ffffff",
    "border": "#d1d9e0",
    "ok": "#1a7f37",
    "bad": "#cf222e",
    "begun": "#6e7781",
    "halted": "#9a6700",
    "good-end": "#dafbe1",
    "bad-end": "#ffebe9",
}
_DARK = {
    "paper": "#0d1117",
    "text": "#f0f6fc",
    "soft": "#9198a1",
    "line": "#656c76",
    "node": "#151b23",
    "even": "#131922",
    "odd": "#0d1117",
    "border": "#30363d",
    "ok": "#3fb950",
    "bad": "#ff7b72",
    "begun": "#9198a1",
    "halted": "#d29922",
    "good-end": "#12261e",
    "bad-end": "#2d1115",
}

_RULES = f"""\
.gpsfsm-picture{{font:12px {_FONT}}}
.gpsfsm-picture .background{{fill:var(--paper)}}
.gpsfsm-picture text{{fill:var(--text);paint-order:stroke;stroke-linejoin:round}}
.gpsfsm-picture .name,.gpsfsm-picture .detail{{text-anchor:middle}}
.gpsfsm-picture .name{{font-weight:600}}
.gpsfsm-picture .detail{{fill:var(--soft)}}
.gpsfsm-picture .join .name,.gpsfsm-picture .join .detail{{font-size:10px;font-weight:400}}
.gpsfsm-picture .caption{{fill:var(--soft);font-size:11px;stroke:var(--paper);stroke-width:3px}}
.gpsfsm-picture .group{{stroke:var(--border);stroke-width:1}}
.gpsfsm-picture .g0{{fill:var(--even)}}
.gpsfsm-picture .g1{{fill:var(--odd)}}
.gpsfsm-picture .node{{fill:var(--node);stroke:var(--line);stroke-width:1.25}}
.gpsfsm-picture .start .node{{fill:var(--even)}}
.gpsfsm-picture .complete .node{{fill:var(--good-end);stroke:var(--ok)}}
.gpsfsm-picture .give_up .node{{fill:var(--bad-end);stroke:var(--bad)}}
.gpsfsm-picture circle.join{{fill:var(--node);stroke-width:1.5}}
.gpsfsm-picture .edge{{fill:none;stroke-width:1.5}}
.gpsfsm-picture .is-bad{{stroke-dasharray:6 3}}
.gpsfsm-picture .is-begun{{stroke-dasharray:1.5 3}}
.gpsfsm-picture .is-halted{{stroke-dasharray:1.5 3}}
.gpsfsm-picture .open{{fill:var(--paper);stroke-width:1.5}}
.gpsfsm-picture .loop{{text-anchor:end}}
.gpsfsm-picture .event{{font-size:9px;stroke:var(--paper);stroke-width:2.5px}}"""


def _variables(colours: dict[str, str]) -> str:
    found = "".join(f"--{name}:{value};" for name, value in colours.items())
    return f".gpsfsm-picture{{{found}}}"


def _kinds() -> str:
    return "\n".join(
        f".gpsfsm-picture .edge.{kind},.gpsfsm-picture .join.{kind},.gpsfsm-picture .open.{kind}"
        f"{{stroke:var(--{kind})}}\n"
        f".gpsfsm-picture .event.{kind},.gpsfsm-picture .head.{kind},"
        f".gpsfsm-picture .dot.{kind}{{fill:var(--{kind})}}"
        for kind in ("ok", "bad", "begun", "halted")
    )


STYLE = "\n".join(
    (
        "",
        _variables(_LIGHT),
        f"@media (prefers-color-scheme:dark){{{_variables(_DARK)}}}",
        _RULES,
        _kinds(),
        "",
    )
)
"""Custom properties hold the colours, so that a page that embeds a picture may set its own."""
