"""The known providers: one module each, found by ``registry``."""
