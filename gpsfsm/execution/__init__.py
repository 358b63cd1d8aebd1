"""Running a checked plan: a deterministic kernel, drivers, the journal (docs/execution.md).

The kernel (``kernel``) is told what happens and says what to do; it knows no clock, no randomness
and no input or output. Drivers give it time and runners: ``virtual`` simulates, ``realtime`` runs,
``replay`` compares, ``explore`` tries everything.
"""
