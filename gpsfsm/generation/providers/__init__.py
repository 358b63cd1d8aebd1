"""Providers of models: ``registry`` finds one by its name, ``known`` holds a module for each.

A provider that is spoken to over HTTP is a ``Dialect``, a builder of requests and a reader of
replies; ``http_model`` and ``transport`` do the rest.
"""
