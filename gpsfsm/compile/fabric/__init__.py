"""The compilers of the original engines: a plan becomes connections, a rejection or a crash.

The text is read by ``gpsfsm.syntax.tinyxml``; the versions differ in data only (``PROFILES``).
"""

from gpsfsm.compile.fabric.compiling import PLAN_ID, PROFILES, Profile, compile_document, listing

__all__ = ["PLAN_ID", "PROFILES", "Profile", "compile_document", "listing"]
