"""The functions of ``gpsfsm`` that take texts or paths and do what a command of that name does.

``plans`` has those about plans, ``answers`` those about what language models write, ``runs`` those
about runs. ``gpsfsm/__init__.py`` says which names are public; nothing is imported here.
"""
