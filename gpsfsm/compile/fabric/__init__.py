"""What the original engines make of a plan: connections, a rejection or a crash.

The text is read by ``gpsfsm.syntax.tinyxml``; the versions differ in data only (``PROFILES``).
"""

from gpsfsm.compile.fabric.compiling import PLAN_ID, compile_document
from gpsfsm.compile.fabric.listing import listing
from gpsfsm.compile.fabric.profiles import PROFILES, Profile

__all__ = ["PLAN_ID", "PROFILES", "Profile", "compile_document", "listing"]
