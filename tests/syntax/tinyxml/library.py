"""The library TinyXML-2 itself, called through ctypes: what our parser is held against.

The wheel ``cmeel-tinyxml2`` ships it as a shared library. Its C++ functions are called by their
mangled names, and objects are made in memory that is large enough for them.
"""

from __future__ import annotations

import ctypes
import re
from importlib import metadata
from typing import NamedTuple

__all__ = ["Library", "Read", "missing"]

_VERSION = "11.0.0"
_ROOM = 1 << 14  # bytes; the objects take less than two thousand
_ERROR = re.compile(rb"Error=(\w+) ErrorID=\d+ \(0x[0-9a-f]+\) Line number=(\d+)")


class Read(NamedTuple):
    """What the library makes of a text: its error and line, or the document printed."""

    error: str
    line: int
    printed: bytes


def missing() -> str:
    """Why the library cannot be used; "" if it can."""
    try:
        version = metadata.version("cmeel-tinyxml2")
    except metadata.PackageNotFoundError:
        return f"cmeel-tinyxml2=={_VERSION} is not installed"
    return "" if version == _VERSION else f"cmeel-tinyxml2 is {version}, not {_VERSION}"


class Library:
    """The loaded library."""

    def __init__(self, path: str = "") -> None:
        tiny = ctypes.CDLL(path or _find())
        self._make_document = tiny["_ZN8tinyxml211XMLDocumentC1EbNS_10WhitespaceE"]
        self._drop_document = tiny["_ZN8tinyxml211XMLDocumentD1Ev"]
        self._parse = tiny["_ZN8tinyxml211XMLDocument5ParseEPKcm"]
        self._error = tiny["_ZNK8tinyxml211XMLDocument8ErrorStrEv"]
        self._error.restype = ctypes.c_char_p
        self._make_printer = tiny["_ZN8tinyxml210XMLPrinterC1EP8_IO_FILEbi"]
        self._write = tiny["_ZNK8tinyxml211XMLDocument5PrintEPNS_10XMLPrinterE"]
        self._libc = ctypes.CDLL(None)
        self._libc.open_memstream.restype = ctypes.c_void_p
        self._libc.fclose.argtypes = [ctypes.c_void_p]
        self._libc.free.argtypes = [ctypes.c_void_p]

    def read(self, data: bytes) -> Read:
        """Parse ``data`` as the engines do: as a C string, with default settings."""
        room = ctypes.create_string_buffer(_ROOM)
        document = ctypes.c_void_p(ctypes.addressof(room))
        self._make_document(document, ctypes.c_bool(True), ctypes.c_int(0))
        size = ctypes.c_size_t(2**64 - 1)  # "as long as the string is"
        if self._parse(document, ctypes.c_char_p(data), size):
            said = self._error(document)
            match = _ERROR.match(said)
            assert match, said
            result = Read(match[1].decode(), int(match[2]), b"")
        else:
            result = Read("", 0, self._print(document))
        self._drop_document(document)
        return result

    def _print(self, document: ctypes.c_void_p) -> bytes:
        room = ctypes.create_string_buffer(_ROOM)
        printer = ctypes.c_void_p(ctypes.addressof(room))
        text, size = ctypes.c_void_p(), ctypes.c_size_t()
        stream = ctypes.c_void_p(self._libc.open_memstream(ctypes.byref(text), ctypes.byref(size)))
        self._make_printer(printer, stream, ctypes.c_bool(False), ctypes.c_int(0))
        self._write(document, printer)
        self._libc.fclose(stream)
        data = ctypes.string_at(text.value, size.value) if text.value else b""
        self._libc.free(text)
        return data


def _find() -> str:
    files = metadata.files("cmeel-tinyxml2") or []
    actual = [file for file in files if file.name == "libtinyxml2.so"]
    assert actual, "the wheel has changed"
    return str(actual[0].locate())
