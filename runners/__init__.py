"""Runner families: capability files and code side by side."""

if __name__ == "runners":
    raise ImportError("import gpsfsm.runners, not runners")
