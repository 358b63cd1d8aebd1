"""Properties of runs, for gpsfsm fuzz."""

from gpsfsm import Run


def says_what_fails(run: Run) -> str | None:
    """Whenever a drive fails, something is said afterwards."""
    driving = [event for event in run.events if "Waypoint" in event.interface]
    failed = [event.at_s for event in driving if event.kind == "FAILED"]
    said = [event.at_s for event in run.events if "Speech" in event.interface]
    if failed and max(said, default=0.0) < failed[-1]:
        return "a drive fails, and nothing is said"
    return None
