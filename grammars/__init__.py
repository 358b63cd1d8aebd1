"""The plan language as RELAX NG and XSD."""

if __name__ == "grammars":
    raise ImportError("import gpsfsm.grammars, not grammars")
