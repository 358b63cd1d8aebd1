"""The families of endpoints, one module each (see ``gpsfsm.service.registry``)."""
