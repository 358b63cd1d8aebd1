"""The language server: what ``gpsfsm check`` finds, in an editor, while a plan is written.

``server`` talks to the editor, ``texts`` holds what it shows, ``checking`` lets a process check it
and ``diagnostics`` writes the findings. Everything else that an editor asks for is one module in
``features``. docs/editors.md tells how to use it.
"""
