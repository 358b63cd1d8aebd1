"""Who is asked: ``registry`` finds a provider by its name, ``known`` holds one module for each.

A provider that is spoken to over HTTP is a ``Dialect``, a builder of requests and a reader of
replies; ``asking`` and ``transport`` do the rest.
"""
