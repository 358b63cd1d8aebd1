"""The known fixes: one module each, found by ``gpsfsm.fixing.registry``."""
