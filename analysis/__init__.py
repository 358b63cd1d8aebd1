"""Analyses: what can go wrong in the runs of an automaton, decided exactly (section 5)."""

if __name__ == "analysis":
    raise ImportError("import gpsfsm.analysis, not analysis")
